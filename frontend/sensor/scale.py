"""The scale of depth: motion measured with it against motion that is known."""

from collections.abc import Sequence

import numpy as np

from semslam.frontend.sensor.estimate import LARGEST_FACTOR, SURE_FACTOR, UNKNOWN_FACTOR, Estimate
from semslam.frontend.sensor.stretch import Stretch
from semslam.geometry.se3 import FloatArray
from semslam.types import Trajectory

LAG = 0.5
"""Seconds over which motion is compared."""
NEAR = 0.15
"""Seconds between poses of the ground truth beyond which nothing is interpolated."""


def depth_factor(stretches: Sequence[Stretch], ground_truth: Trajectory) -> Estimate:
    """Measured depth divided by the true one, with its scatter over stretches (jackknife).

    Args:
        stretches: solved, so that their poses are in units of the measured depth.
        ground_truth: camera poses T_world_cam in metres.
    """
    sums = np.array([_sums(stretch, ground_truth) for stretch in stretches])
    sums = sums[sums[:, 1] > 0]
    if len(sums) < 3:
        return UNKNOWN_FACTOR
    whole = sums.sum(0)
    without = (whole - sums)[:, 0] / (whole - sums)[:, 1]
    sigma = np.sqrt((len(sums) - 1) * without.var())
    return Estimate(float(whole[0] / whole[1]), float(sigma), SURE_FACTOR, LARGEST_FACTOR)


def _sums(stretch: Stretch, ground_truth: Trajectory) -> FloatArray:
    """Sums (2,) of estimated times true lengths of motion, and of squared true ones."""
    known = _known(stretch.times, ground_truth.timestamps)
    later = np.searchsorted(stretch.times, stretch.times + LAG)
    pairs = [(i, j) for i, j in enumerate(later) if j < len(known) and known[i] and known[j]]
    measured = _lengths(stretch.poses[:, :3, 3], pairs)
    true = _lengths(_positions(stretch.times, ground_truth), pairs)
    return np.array([measured @ true, true @ true])


def _lengths(positions: FloatArray, pairs: Sequence[tuple[int, int]]) -> FloatArray:
    return np.array([np.linalg.norm(positions[j] - positions[i]) for i, j in pairs])


def _known(times: FloatArray, stamps: FloatArray) -> FloatArray:
    """Whether the ground truth has poses just before and after times (N,)."""
    after = np.clip(np.searchsorted(stamps, times), 1, len(stamps) - 1)
    return np.asarray((np.abs(stamps[after] - times) < NEAR) & (np.abs(times - stamps[after - 1]) < NEAR))


def _positions(times: FloatArray, ground_truth: Trajectory) -> FloatArray:
    columns = ground_truth.poses[:, :3, 3].T
    return np.stack([np.interp(times, ground_truth.timestamps, column) for column in columns], 1)
