"""The role of odometry."""

from typing import Protocol, Self, runtime_checkable

from semslam.config import Config
from semslam.types import Frame, Motion


@runtime_checkable
class Odometry(Protocol):
    """Tracks a camera from frame to frame.

    A frame that cannot be tracked is a status in the returned motion (LOST, with a predicted motion and a wide
    covariance): never an exception and never a silent identity. Deterministic for a seed.

    Attributes:
        name: the registered name.
        reads: the settings that the motions depend on, as dotted names of sections or single settings; a saved run can
            be replayed with any other setting changed.
    """

    name: str
    reads: tuple[str, ...]

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        ...

    def track(self, frame: Frame) -> Motion:
        """Motion since the previous frame; the first frame returns identity with status OK.

        Raises:
            DatasetError: the frame's size does not fit its intrinsics.
        """
