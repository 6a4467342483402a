"""Points of the map: positions, descriptors, and how often they were observed."""

import numpy as np
import numpy.typing as npt

from semslam.types import FloatArray, IntArray, UInt8Array

NONE = -1
"""In place of a landmark's identity: a keypoint that belongs to none."""
OBSERVERS = 32
"""How many of the latest keyframes that observe it a landmark stores, so that no search grows with the map."""


_COLUMNS = (
    "positions", "descriptors", "directions", "reach", "born", "visible", "found", "alive", "observations", "observers",
)  # fmt: skip


class Landmarks:
    """Landmarks by identity: rows of arrays that grow; an identity is never used twice.

    Attributes:
        positions: (M, 3) metres, in their map's frame.
        descriptors: (M, 32) uint8.
        directions: (M, 3) unit vectors from the camera that first saw each to it.
        reach: (M,) distance in metres at which each would be seen in the finest pyramid level.
        born: (M,) id of the keyframe that made each.
        visible: (M,) how often each should have been seen.
        found: (M,) how often it was.
        alive: (M,) bool.
        observers: (M, OBSERVERS) keyframes that saw each last, in no order; NONE where there are fewer.
    """

    def __init__(self) -> None:
        self._count = 0
        self._positions = np.zeros((1024, 3))
        self._descriptors = np.zeros((1024, 32), dtype=np.uint8)
        self._directions = np.zeros((1024, 3))
        self._reach = np.zeros(1024)
        self._born = np.zeros(1024, dtype=np.int64)
        self._visible = np.zeros(1024, dtype=np.int64)
        self._found = np.zeros(1024, dtype=np.int64)
        self._alive = np.zeros(1024, dtype=bool)
        self._observations = np.zeros(1024, dtype=np.int64)
        self._observers = np.full((1024, OBSERVERS), NONE, dtype=np.int32)

    def __len__(self) -> int:
        return self._count

    @property
    def positions(self) -> FloatArray:
        """(M, 3) metres; may be written."""
        return self._positions[: self._count]

    @property
    def descriptors(self) -> UInt8Array:
        """(M, 32) uint8; may be written."""
        return self._descriptors[: self._count]

    @property
    def directions(self) -> FloatArray:
        """(M, 3) unit vectors; may be written."""
        return self._directions[: self._count]

    @property
    def reach(self) -> FloatArray:
        """(M,) metres; may be written."""
        return self._reach[: self._count]

    @property
    def born(self) -> IntArray:
        """(M,) keyframe ids."""
        return self._born[: self._count]

    @property
    def visible(self) -> IntArray:
        """(M,) counts; may be written."""
        return self._visible[: self._count]

    @property
    def found(self) -> IntArray:
        """(M,) counts; may be written."""
        return self._found[: self._count]

    @property
    def alive(self) -> npt.NDArray[np.bool_]:
        """(M,) bool; may be written."""
        return self._alive[: self._count]

    @property
    def observers(self) -> npt.NDArray[np.int32]:
        """(M, OBSERVERS) keyframe ids."""
        return self._observers[: self._count]

    def note(self, landmarks: IntArray, keyframe: int) -> None:
        """Remember that a keyframe sees some landmarks."""
        self._observers[landmarks, self._observations[landmarks] % OBSERVERS] = keyframe
        self._observations[landmarks] += 1

    def add(
        self,
        positions: FloatArray,
        descriptors: UInt8Array,
        directions: FloatArray,
        reach: FloatArray,
        keyframe: int,
    ) -> IntArray:
        """Make landmarks; gives their identities (N,)."""
        first, self._count = self._count, self._count + len(positions)
        self._grow()
        rows = slice(first, self._count)
        self._positions[rows] = positions
        self._descriptors[rows] = descriptors
        self._directions[rows] = directions
        self._reach[rows] = reach
        self._born[rows] = keyframe
        self._visible[rows] = self._found[rows] = 1
        self._alive[rows] = True
        self._observations[rows] = 0
        self._observers[rows] = NONE
        return np.arange(first, self._count)

    def _grow(self) -> None:
        if self._count <= len(self._positions):
            return
        for name in _COLUMNS:
            old = getattr(self, f"_{name}")
            new = np.zeros((2 * self._count, *old.shape[1:]), dtype=old.dtype)
            new[: len(old)] = old
            setattr(self, f"_{name}", new)
