"""The read-out time of colour and of depth, and the delay between them, from a recording alone."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from semslam.frontend.sensor.estimate import UNKNOWN_FACTOR, Estimate, SensorEstimate, a_time
from semslam.frontend.sensor.scale import depth_factor
from semslam.frontend.sensor.stretch import PARAMETERS, Equations, Stretch, begin
from semslam.geometry.se3 import FloatArray
from semslam.runtime.threads import one_blas_thread
from semslam.types import Frame, Trajectory

RATE = 16.0
"""Images a second that are used at most: enough to draw the motion between them."""
SECONDS, FEWEST = 1.2, 10
"""Length of a stretch, and images it has at least."""
GAP = 0.3
"""Seconds between images beyond which a stretch ends."""
STRETCHES = 5
"""Stretches that suffice."""
ENOUGH = 3
"""Stretches below which nothing is determined: their scatter is what the uncertainty rests on."""
PRIOR = np.array([0.05, 0.05, 0.05, 1.0, 1.0, 0.5])
"""Standard deviations around zero of what is estimated, see ``PARAMETERS``; wide, but for depth against colour."""
FARTHEST = np.array([0.1, 0.1, 0.1, 10.0, 10.0, 5.0])
"""How far from zero they may get on the way."""
STEPS, RELAXATION, SETTLED = 14, 1.3, 2e-5
"""Steps at most, the factor on each, and the seconds below which steps end."""
FLOOR, SPREAD = 7e-4, 1.5
"""Seconds of error that remain with any number of points, and the factor on what equations or scatter state: optical
flow errs alike along a track. Both from rendered sequences (BENCHMARKS.md, "Sensors")."""


def calibrate(
    frames: Iterable[Frame], stretches: int = STRETCHES, ground_truth: Trajectory | None = None
) -> SensorEstimate:
    """Estimate a sensor's timing from the first frames of a recording, and with ground truth its scale.

    Rolling shutters and delays show where the camera's velocity changes. Points are followed through stretches of about
    a second; poses, points and the times are adjusted together, and the scatter over the stretches counts as
    uncertainty where it is larger than what the equations state.

    Args:
        frames: of one camera, in order; as many are read as are needed.
        stretches: number of stretches after which no more frames are read.
        ground_truth: camera poses, for the scale of depth.
    """
    found: list[Stretch] = []
    try:
        with one_blas_thread():
            for part in _parts(frames):
                stretch = begin(part, _thinned(part))
                if stretch is not None:
                    found.append(stretch)
                if len(found) == stretches:
                    break
            if len(found) < ENOUGH:
                return SensorEstimate(stretches=len(found))
            readout, delay, depth_readout = _solve(found)
    except np.linalg.LinAlgError:  # what is seen fixes no pose
        return SensorEstimate(stretches=len(found))
    factor = UNKNOWN_FACTOR if ground_truth is None else depth_factor(found, ground_truth)
    return SensorEstimate(readout, delay, depth_readout, factor, len(found))


def _parts(frames: Iterable[Frame]) -> Iterator[list[Frame]]:
    """Frames in stretches without gaps."""
    part: list[Frame] = []
    for frame in frames:
        if part and frame.timestamp - part[-1].timestamp > GAP:
            part = []
        part.append(frame)
        if len(part) >= FEWEST and frame.timestamp - part[0].timestamp >= SECONDS:
            yield part
            part = []


def _thinned(frames: Sequence[Frame]) -> list[int]:
    """Numbers of the frames that are left at the rate."""
    kept = [0]
    for number, frame in enumerate(frames):
        if frame.timestamp - frames[kept[-1]].timestamp >= 1 / RATE - 1e-3:
            kept.append(number)
    return kept


def _solve(stretches: Sequence[Stretch]) -> list[Estimate]:
    """The three times."""
    values = np.zeros(len(PARAMETERS))
    information = PRIOR**-2.0
    for _ in range(STEPS):
        equations = [stretch.eliminate(values) for stretch in stretches]
        H = sum((e.H for e in equations), np.diag(information))
        gradient = sum((e.g for e in equations), -values * information)
        step = np.asarray(RELAXATION * np.linalg.solve(H, gradient), dtype=np.float64)
        values = np.clip(values + step, -FARTHEST, FARTHEST)
        for stretch in stretches:
            stretch.substitute(step)
        if np.abs(step[:3]).max() < SETTLED:
            break
    stated = SPREAD * _sigmas([stretch.eliminate(values) for stretch in stretches], information)
    sigmas = np.hypot(stated, FLOOR) + np.abs(step)
    return [a_time(float(values[i]), float(sigmas[i])) for i in range(3)]


def _sigmas(equations: Sequence[Equations], information: FloatArray) -> FloatArray:
    """Standard deviations (P,): from the equations and residuals, or from the scatter over stretches if larger."""
    covariance = np.linalg.inv(sum((e.H for e in equations), np.diag(information)))
    variance = sum(e.square for e in equations) / sum(e.freedom for e in equations)
    gradients = np.stack([e.g for e in equations])
    gradients -= gradients.mean(0)
    scatter = covariance @ (gradients.T @ gradients) @ covariance * (len(equations) / (len(equations) - 1))
    return np.asarray(np.sqrt(np.maximum(np.diag(covariance) * max(variance, 1.0), np.diag(scatter))))
