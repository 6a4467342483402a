"""Trajectories against ground truth: absolute and relative errors, coverage, alignment.

Association and alignment are evo's. evo scores the overlap alone, so a coverage belongs beside every error.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from semslam.errors import TrajectoryError
from semslam.eval.metrics import Comparison, TrajectoryMetrics, rms
from semslam.geometry.se3 import (
    FloatArray,
    Transform,
    Transforms,
    invert,
    quaternions_to_rotations,
    rotations_to_quaternions,
)
from semslam.types import Trajectory

MAX_DIFFERENCE = 0.02
RPE_INTERVAL = 1.0
MIN_PAIRS = 3
MIN_SHARE = 0.05
"""Share of the poses that ground truth must meet; errors of fewer are no measure of a trajectory."""
MIN_COVERAGE = 0.5
TRIPOD = 1e-3

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Poses that belong together: stamps (K,) of the estimate, estimated and true poses (K, 4, 4)."""

    timestamps: FloatArray
    estimated: FloatArray
    true: FloatArray

    def __len__(self) -> int:
        return len(self.timestamps)


@dataclass(frozen=True, slots=True, eq=False)
class Similarity:
    """An alignment p -> scale * R p + t, with R and t in ``T`` (4, 4)."""

    T: Transform
    scale: float

    def apply(self, poses: Transforms) -> Transforms:
        """Move poses (N, 4, 4): positions by the similarity, rotations by R alone."""
        scaled = poses.copy()
        scaled[:, :3, 3] *= self.scale
        return np.asarray(self.T @ scaled)


def score_trajectory(
    estimate: Trajectory, truth: Trajectory, max_difference: float = MAX_DIFFERENCE, min_share: float = MIN_SHARE
) -> TrajectoryMetrics:
    """Score an estimate where ground truth covers it.

    Args:
        estimate: poses in any world frame.
        truth: the ground truth.
        max_difference: seconds that associated stamps may differ.
        min_share: of the poses that must have ground truth.

    Raises:
        TrajectoryError: fewer poses have ground truth, or fewer than three.
    """
    pairs = associate(estimate, truth, max_difference, min_share)
    return TrajectoryMetrics.of(
        Comparison(
            position_errors=_position_errors(pairs, fit_alignment(pairs)),
            similarity_errors=_position_errors(pairs, fit_alignment(pairs, with_scale=True)),
            relative_errors=relative_errors(pairs),
        )
    )


def associate(
    estimate: Trajectory, truth: Trajectory, max_difference: float = MAX_DIFFERENCE, min_share: float = MIN_SHARE
) -> Pairs:
    """Pair poses by time as evo does: each pose of the shorter trajectory with the nearest one of the longer.

    Args:
        estimate: poses in any world frame.
        truth: the ground truth.
        max_difference: seconds that associated stamps may differ.
        min_share: of the poses that must have a partner.

    Raises:
        TrajectoryError: fewer poses have one, or fewer than three.
    """
    from evo.core.sync import SyncException, associate_trajectories
    from evo.core.trajectory import PoseTrajectory3D

    if not len(estimate) or not len(truth):
        raise TrajectoryError("The estimate or the ground truth holds no pose.")
    both = [PoseTrajectory3D(poses_se3=list(t.poses), timestamps=t.timestamps) for t in (truth, estimate)]
    try:
        matched_truth, matched = associate_trajectories(*both, max_diff=max_difference)
        found = matched.num_poses
    except SyncException:
        found = 0
    if found < MIN_PAIRS or found < min_share * len(estimate):
        raise TrajectoryError(
            f"Only {found} of {len(estimate)} poses have ground truth within {max_difference:g} s, too few for a score;"
            f" the estimate spans {_span(estimate)}, the truth {_span(truth)}{_numbered(truth, estimate)}."
        )
    return Pairs(np.asarray(matched.timestamps), np.stack(matched.poses_se3), np.stack(matched_truth.poses_se3))


def fit_alignment(pairs: Pairs, with_scale: bool = False) -> Similarity:
    """The least-squares alignment of estimated onto true positions (Umeyama, 1991), SE(3) or Sim(3).

    Positions on a line, or at one point, leave a rotation open; there the orientations decide it, each pose
    standing for its position and three points a millimetre along its axes.
    """
    from evo.core.geometry import GeometryException, umeyama_alignment

    points = [poses[:, :3, 3] for poses in (pairs.estimated, pairs.true)]
    try:
        R, t, scale = umeyama_alignment(*(p.T for p in points), with_scale)
    except GeometryException:
        tripods = [_tripods(poses) for poses in (pairs.estimated, pairs.true)]
        R, t, scale = umeyama_alignment(*(p.T for p in tripods), with_scale)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return Similarity(T, float(scale))


def align(estimate: Trajectory, truth: Trajectory, max_difference: float = MAX_DIFFERENCE) -> Trajectory:
    """The whole estimate moved rigidly onto the truth, fitted where they overlap.

    Raises:
        TrajectoryError: fewer than three poses have ground truth.
    """
    fitted = fit_alignment(associate(estimate, truth, max_difference))
    return Trajectory(estimate.timestamps, fitted.apply(estimate.poses))


def position_errors(
    estimate: Trajectory, truth: Trajectory, max_difference: float = MAX_DIFFERENCE
) -> tuple[FloatArray, FloatArray]:
    """Stamps (K,) and position errors (K,) in metres after SE(3) alignment.

    Raises:
        TrajectoryError: fewer than three poses have ground truth.
    """
    pairs = associate(estimate, truth, max_difference)
    return pairs.timestamps, _position_errors(pairs, fit_alignment(pairs))


def rmse_after_alignment(pairs: Pairs) -> float:
    """Absolute trajectory error: root mean square position error in metres after SE(3) alignment."""
    return rms(_position_errors(pairs, fit_alignment(pairs)))


def relative_errors(pairs: Pairs, interval: float = RPE_INTERVAL) -> FloatArray:
    """Errors (M, 4, 4) of the motion over ``interval`` seconds, for all poses that have a partner that much later.

    The error is inv(true motion) times estimated motion (Sturm et al., 2012). The partner's stamp is the nearest
    one to the interval's end and at most half a typical frame distance off.
    """
    stamps = pairs.timestamps
    steps = np.diff(stamps)
    tolerance = 0.5 * float(np.median(steps[steps > 0])) + 1e-6 if (steps > 0).any() else 0.0
    partner = _nearest(stamps, stamps + interval)
    first = np.flatnonzero(np.abs(stamps[partner] - stamps - interval) <= tolerance)
    second = partner[first]
    true_motion = invert(pairs.true[first]) @ pairs.true[second]
    return np.asarray(invert(true_motion) @ invert(pairs.estimated[first]) @ pairs.estimated[second])


def coverage(timestamps: npt.ArrayLike, truth: Trajectory, window: float = MAX_DIFFERENCE) -> float:
    """Share of the stamps (N,) that have ground truth within ``window`` seconds; 0 for no stamps."""
    stamps = np.asarray(timestamps, dtype=np.float64)
    if not len(stamps) or not len(truth):
        return 0.0
    return float(np.mean(np.abs(truth.timestamps[_nearest(truth.timestamps, stamps)] - stamps) <= window))


def coverage_remark(pairs: int | None, poses: int) -> str | None:
    """A warning where errors are of less than half of the poses, which are no measure of the others; else None."""
    if not pairs or pairs >= MIN_COVERAGE * poses:
        return None
    return f"The errors are of {pairs} of {poses} poses ({100 * pairs / poses:.0f} %); the others are not scored."


def poses_at(truth: Trajectory, timestamps: npt.ArrayLike, max_gap: float = 0.1) -> tuple[FloatArray, BoolArray]:
    """Poses interpolated at the stamps (N,): straight lines between positions, slerp between rotations.

    Args:
        truth: poses to interpolate.
        timestamps: seconds, in any order.
        max_gap: seconds; a stamp within a longer hole of the truth, or outside it, is not covered.

    Returns:
        Poses (N, 4, 4), identity where not covered, and the mask (N,) of those that are.
    """
    stamps = np.asarray(timestamps, dtype=np.float64)
    poses = np.tile(np.eye(4), (len(stamps), 1, 1))
    if not len(truth):
        return poses, np.zeros(len(stamps), dtype=bool)
    after = np.searchsorted(truth.timestamps, stamps).clip(0, len(truth) - 1)
    exact = truth.timestamps[after] == stamps
    before = np.where(exact, after, (after - 1).clip(0))
    start, end = truth.timestamps[before], truth.timestamps[after]
    covered = (start <= stamps) & (stamps <= end) & (end - start <= max_gap)
    share = (stamps - start) / np.where(end > start, end - start, 1.0)
    a, b, w = truth.poses[before[covered]], truth.poses[after[covered]], share[covered, None]
    poses[covered, :3, 3] = (1 - w) * a[:, :3, 3] + w * b[:, :3, 3]
    poses[covered, :3, :3] = _slerp(a[:, :3, :3], b[:, :3, :3], w)
    return poses, covered


def _slerp(a: FloatArray, b: FloatArray, share: FloatArray) -> FloatArray:
    """Rotations (N, 3, 3) at ``share`` (N, 1) of the way from a to b."""
    if not len(a):
        return a
    p, q = rotations_to_quaternions(a), rotations_to_quaternions(b)
    cosine = np.sum(p * q, axis=1, keepdims=True)
    q = np.where(cosine < 0, -q, q)
    angle = np.arccos(np.abs(cosine).clip(0.0, 1.0))
    near = angle < 1e-6
    sine = np.where(near, 1.0, np.sin(angle))
    left = np.where(near, 1 - share, np.sin((1 - share) * angle) / sine)
    right = np.where(near, share, np.sin(share * angle) / sine)
    return quaternions_to_rotations(left * p + right * q)


def _nearest(sorted_stamps: FloatArray, wanted: FloatArray) -> npt.NDArray[np.intp]:
    """Index of the nearest of the ascending stamps for each wanted one."""
    after = np.searchsorted(sorted_stamps, wanted).clip(0, len(sorted_stamps) - 1)
    before = (after - 1).clip(0)
    closer = np.abs(sorted_stamps[before] - wanted) <= np.abs(sorted_stamps[after] - wanted)
    return np.where(closer, before, after)


def _tripods(poses: Transforms) -> FloatArray:
    feet = TRIPOD * np.concatenate([np.zeros((1, 3)), np.eye(3)])
    return np.asarray(poses[:, None, :3, 3] + feet @ np.swapaxes(poses[:, :3, :3], 1, 2)).reshape(-1, 3)


def _position_errors(pairs: Pairs, alignment: Similarity) -> FloatArray:
    moved = alignment.apply(pairs.estimated)
    return np.asarray(np.linalg.norm(moved[:, :3, 3] - pairs.true[:, :3, 3], axis=1))


def score_remark(estimate: Trajectory, truth: Trajectory | None, score: TrajectoryMetrics, poses: int) -> str | None:
    """What a score does not cover; why there is none; or None.

    Args:
        estimate: what was scored.
        truth: the ground truth, if there is any.
        score: its errors.
        poses: how many there are, those included that were not tracked.
    """
    if truth is not None and score.pairs is None:
        try:
            associate(estimate, truth)
        except TrajectoryError as error:
            return f"There is no score: {error}"
    return coverage_remark(score.pairs, poses)


def _numbered(truth: Trajectory, estimate: Trajectory) -> str:
    """A hint where the stamps of the truth are frame numbers, and those of the estimate are not."""
    if len(truth) > 1 and (np.diff(truth.timestamps) == 1).all() and not (estimate.timestamps % 1 == 0).all():
        return "; its stamps are frame numbers, not seconds"
    return ""


def _span(trajectory: Trajectory) -> str:
    return f"{trajectory.timestamps[0]:.3f} to {trajectory.timestamps[-1]:.3f} s"
