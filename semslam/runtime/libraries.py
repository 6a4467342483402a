"""Large libraries loaded ahead of their first use."""

import sys
from contextlib import suppress
from threading import Thread
from types import ModuleType


def load_registration_ahead() -> None:
    """Load what registration uses in a thread, so that the first loop need not wait for it.

    For a process of this program's own: Open3D is loaded without Dash, which it imports for a viewer in the browser and
    which takes as long to load as all the rest of it.
    """
    Thread(target=_load_registration, name="semslam-loading").start()


def _load_registration() -> None:
    without = ModuleType("dash")
    vars(without).update(html=None, dcc=None, Dash=None)
    is_stubbed = sys.modules.setdefault("dash", without) is without
    try:
        with suppress(ImportError):  # the first use states what is missing
            import open3d  # noqa: F401
            import scipy.spatial  # noqa: F401
    finally:
        if is_stubbed:
            del sys.modules["dash"]
