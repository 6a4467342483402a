"""What a recording states of its sensor, and how surely."""

from dataclasses import dataclass, replace

from semslam.datasets.camera_file import CameraSetup

SURE, LONGEST = 1.5e-3, 0.06
"""Seconds of standard deviation up to which a time counts as determined, and the longest read-out or delay."""
FASTEST = 0.004
"""Seconds; a shorter read-out is a global shutter's: no rolling one is as fast."""
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
        """A camera with what is determined; what is not stays as it is."""
        camera, units = setup.intrinsics, setup.depth_scale
        if units is not None and self.depth_factor.is_determined:
            units = round(units * self.depth_factor.value, 3)
        timed = replace(
            camera,
            readout=_readout(self.readout) if self.readout.is_determined else camera.readout,
            delay=round(self.delay.value, 6) if self.delay.is_determined else camera.delay,
            depth_readout=_readout(self.depth_readout) if self.depth_readout.is_determined else camera.depth_readout,
        )
        return replace(setup, intrinsics=timed, depth_scale=units)


def _readout(found: Estimate) -> float:
    """Seconds, or none where it is too short for a rolling shutter or does not differ from none."""
    return round(found.value, 6) if found.value > max(FASTEST, 2 * found.sigma) else 0.0
