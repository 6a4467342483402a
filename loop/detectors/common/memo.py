"""What was last computed of a view, so that ``query`` and ``add`` of one keyframe share the work."""

import weakref
from collections.abc import Callable
from typing import Generic, TypeVar

from semslam.types import Keyframe, KeyframeView, UInt8Array

ResultT = TypeVar("ResultT")


class LastView(Generic[ResultT]):
    """Computes something of a view, once while the same view comes again; the images themselves are not kept.

    Args:
        compute: what to compute; a function of the view alone.
    """

    def __init__(self, compute: Callable[[KeyframeView], ResultT]) -> None:
        self._compute = compute
        self._last: tuple[Keyframe, weakref.ref[UInt8Array], ResultT] | None = None

    def __call__(self, view: KeyframeView) -> ResultT:
        """The result for a view."""
        if self._last is not None and self._last[0] is view.keyframe and self._last[1]() is view.color:
            return self._last[2]
        result = self._compute(view)
        self._last = (view.keyframe, weakref.ref(view.color), result)
        return result
