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


@runtime_checkable
class Preparing(Protocol):
    """An odometry that does part of its work from the frame alone, so that it can be done before the frame's turn.

    An odometry may lack it. ``track`` gives the same motion whether its frame was prepared or not.
    """

    def prepare(self, frame: Frame) -> None:
        """Do that work for a frame that ``track`` is to be given later, perhaps in another thread than ``track``.

        Frames are prepared one at a time and in order.

        Raises:
            DatasetError: the frame's size does not fit its intrinsics.
        """
