"""What a recording states of its sensor, and how surely."""

from dataclasses import dataclass, replace

from semslam.datasets.camera_file import CameraSetup

SURE, LONGEST = 1.5e-3, 0.06
"""Seconds of standard deviation up to which a time counts as determined, and the longest read-out or delay."""
FASTEST = 0.004
"""Seconds; a shorter read-out is a global shutter's: no rolling one is as fast."""
ROUGH, CLEAR = 2.0, 4.0
"""Multiple of the limit up to which a value is roughly known, and the standard deviations by which it must then differ
from what is assumed without it."""
SURE_FACTOR, LARGEST_FACTOR = 0.01, 10.0
"""The same of the depth factor."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """What a recording states of a quantity.

    Attributes:
        value: in the quantity's unit.
        sigma: standard deviation.
        limit: standard deviation up to which it counts as determined.
        range: absolute value beyond which it is not believed.
    """

    value: float
    sigma: float
    limit: float
    range: float

    @property
    def is_determined(self) -> bool:
        """Whether the recording determines it."""
        return self.sigma <= self.limit and abs(self.value) <= self.range

    @property
    def is_rough(self) -> bool:
        """Whether the recording does not determine it, but says roughly what it is."""
        return self.limit < self.sigma <= ROUGH * self.limit and abs(self.value) <= self.range

    def is_better_than(self, assumed: float) -> bool:
        """Whether to go by it and not by what is assumed: it is determined, or known roughly to be something else."""
        return self.is_determined or (self.is_rough and abs(self.value - assumed) > CLEAR * self.sigma)


def a_time(seconds: float, sigma: float) -> Estimate:
    """An estimated read-out or delay."""
    return Estimate(seconds, sigma, SURE, LONGEST)


UNKNOWN_TIME = a_time(0.0, LONGEST)
UNKNOWN_FACTOR = Estimate(1.0, 1.0, SURE_FACTOR, LARGEST_FACTOR)


@dataclass(frozen=True, slots=True)
class SensorEstimate:
    """When rows of colour and depth are exposed, and the scale of depth.

    Attributes:
        readout: seconds from colour's first row to its last.
        delay: seconds from colour's middle row to depth's.
        depth_readout: seconds from depth's first row to its last.
        depth_factor: measured depth divided by the true one; only ground truth determines it.
        stretches: stretches of the recording it rests on.
    """

    readout: Estimate = UNKNOWN_TIME
    delay: Estimate = UNKNOWN_TIME
    depth_readout: Estimate = UNKNOWN_TIME
    depth_factor: Estimate = UNKNOWN_FACTOR
    stretches: int = 0

    @property
    def is_determined(self) -> bool:
        """Whether the recording determines any of it."""
        found = (self.readout, self.delay, self.depth_readout, self.depth_factor)
        return any(estimate.is_determined for estimate in found)

    def applied(self, setup: CameraSetup) -> CameraSetup:
        """A camera with what is determined, or known roughly and far from what it states; the rest stays as it is."""
        camera, units = setup.intrinsics, setup.depth_scale
        if units is not None and self.depth_factor.is_determined:
            units = round(units * self.depth_factor.value, 3)
        if self.readout.is_better_than(camera.readout or 0.0):
            camera = replace(camera, readout=_readout(self.readout))
        if self.delay.is_better_than(camera.delay):
            camera = replace(camera, delay=round(self.delay.value, 6))
        if self.depth_readout.is_better_than(camera.depth_readout_beside(camera.readout or 0.0)):
            camera = replace(camera, depth_readout=_readout(self.depth_readout))
        return replace(setup, intrinsics=camera, depth_scale=units)


def _readout(found: Estimate) -> float:
    """Seconds, or none where it is too short for a rolling shutter or does not differ from none."""
    return round(found.value, 6) if found.value > max(FASTEST, 2 * found.sigma) else 0.0
