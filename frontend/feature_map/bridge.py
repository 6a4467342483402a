"""Registration of frames that do not match the tracker's map to the frame before."""

from typing import Protocol

from semslam.frontend.frame_to_frame.dense import DenseConfig, DenseRegistrar
from semslam.frontend.frame_to_frame.reference import Registration
from semslam.types import Frame, Transform


class Bridge(Protocol):
    """Registers a frame to the one before, without a map."""

    def note(self, frame: Frame) -> None:
        """Remember a frame as the one before the next."""

    def register(self, frame: Frame, T_prev_cur: Transform) -> Registration | None:
        """Motion since the noted frame from an initial guess, or None where the two do not match."""


class NoBridge:
    """Registers nothing."""

    def note(self, frame: Frame) -> None:
        """Remember nothing."""

    def register(self, frame: Frame, T_prev_cur: Transform) -> Registration | None:
        """None."""
        del frame, T_prev_cur
        return None


class DenseBridge:
    """Registers colour and depth of all pixels, which works where there are few corners."""

    def __init__(self, config: DenseConfig) -> None:
        self._max_seconds = config.max_bridge
        self._registrar = DenseRegistrar(config)
        self._previous: Frame | None = None

    def note(self, frame: Frame) -> None:
        """Remember a frame as the one before the next."""
        self._previous = frame

    def register(self, frame: Frame, T_prev_cur: Transform) -> Registration | None:
        """Motion since the noted frame; None after a gap in time or where too few pixels agree."""
        previous = self._previous
        if previous is None or frame.timestamp - previous.timestamp > self._max_seconds:
            return None
        reference, current = self._registrar.prepare(previous), self._registrar.prepare(frame)
        if reference is None or current is None:
            return None
        found = self._registrar.register(reference, current, T_prev_cur)
        return None if found is None or found.degraded else found
