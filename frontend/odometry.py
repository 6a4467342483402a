"""The role of odometry."""

from typing import Protocol, runtime_checkable

from semslam.types import Frame, Motion


@runtime_checkable
class Odometry(Protocol):
    """Tracks a camera from frame to frame.

    A frame that cannot be tracked is a status in the returned motion (LOST, with a predicted motion and a wide
    covariance): never an exception and never a silent identity. Deterministic for a seed.
    """

    def track(self, frame: Frame) -> Motion:
        """Motion since the previous frame; the first frame returns identity with status OK.

        Raises:
            DatasetError: the frame's size does not fit its intrinsics.
        """
