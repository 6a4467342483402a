"""When the rows of colour and of depth were seen, as registration needs it: in parts of the motion between frames."""

from dataclasses import dataclass

import numpy as np

from semslam.types import FloatArray, Intrinsics, Points3


@dataclass(frozen=True, slots=True)
class Clock:
    """The instants of an image's rows, in parts of the time between both frames.

    Attributes:
        late: from the frame's instant to that of the principal point's row.
        span: from the first row to the last.
    """

    late: float
    span: float

    def at(self, rows: FloatArray) -> FloatArray:
        """Instants (N,) of rows (N,), which count from the principal point's in heights of the image."""
        return self.late + self.span * rows


@dataclass(frozen=True, slots=True, eq=False)
class Clocks:
    """The instants of both images of a frame, and how the camera moved meanwhile.

    Motions are tangents (6,) over the time between both frames. Velocity changes evenly, so that it is half a frame's
    change away from the mean at either frame.

    Attributes:
        color, depth: the images' rows.
        before: (6,) motion over as long a time until the reference; None = not known, and velocity is even.
    """

    color: Clock
    depth: Clock
    before: FloatArray | None

    @property
    def are_one(self) -> bool:
        """Whether colour and depth of one row are of one instant."""
        return self.color == self.depth

    @property
    def shares(self) -> tuple[float, float]:
        """How much of the motion between the frames counts in that at the frame, and in that at the reference."""
        return (1.0, 1.0) if self.before is None else (1.5, 0.5)

    def at_frame(self, motion: FloatArray) -> FloatArray:
        """The motion (6,) at the frame, of that between the frames."""
        return self._mixed(self.shares[0], motion)

    def at_reference(self, motion: FloatArray) -> FloatArray:
        """The motion (6,) at the reference, of that between the frames."""
        return self._mixed(self.shares[1], motion)

    def _mixed(self, share: float, motion: FloatArray) -> FloatArray:
        return motion if self.before is None else share * motion + (1.0 - share) * self.before


def clocks_of(camera: Intrinsics, readout: float, seconds: float, before: FloatArray | None) -> Clocks | None:
    """The clocks of a camera, or None where all rows of both images are of one instant.

    Args:
        camera: states the read-out of depth and its delay after colour.
        readout: seconds from colour's first row to its last.
        seconds: from the one frame to the other.
        before: (6,) motion over as long a time until the reference, or None.
    """
    depth_readout = camera.depth_readout_beside(readout)
    if readout == depth_readout == camera.delay == 0:
        return None
    return Clocks(Clock(0.0, readout / seconds), Clock(camera.delay / seconds, depth_readout / seconds), before)


def moved(points: Points3, motion: FloatArray, parts: FloatArray) -> Points3:
    """Points (N, 3) in the camera as it was parts (N,) of a motion, a tangent (6,), before: to first order."""
    x, y, z = motion[:3]
    turned = points @ np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # a cross product, by a matrix product
    return np.asarray(points + parts[:, None] * (turned + motion[3:]))
