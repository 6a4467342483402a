"""Bundle adjustment over keyframes and their landmarks: the step that pose graphs lack.

Depth enters as the disparity of a virtual stereo pair, so that its error grows with distance as a depth camera's
does (Mur-Artal and Tardos, "ORB-SLAM2", T-RO 2017, section III-A).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import gtsam
import numpy as np
import numpy.typing as npt

from semslam.backend.bundle.held_out import HeldOut, choose, compare
from semslam.backend.bundle.observations import ObservationTable, reprojection_errors, spread, thinned
from semslam.backend.graph.checks import checked_pose
from semslam.backend.graph.factors import (
    ANCHOR_SIGMA,
    FLOATING_SIGMA,
    between_factor,
    make_values,
    prior_factor,
    read_poses,
)
from semslam.backend.graph.products import Edge
from semslam.backend.robust.least_squares import optimise
from semslam.config import BundleConfig
from semslam.errors import GraphError
from semslam.types import FloatArray, Intrinsics, Observations, Transform

TOLERANCE = 1e-4
"""Relative change of the cost at which a round ends."""
HUBER_K = 2.0
"""Whitened error from which an observation counts less."""


@dataclass(frozen=True, slots=True)
class BundleRound:
    """One adjustment.

    Attributes:
        observations: how many took part.
        dropped: how many were found to be outliers by it.
        rmse_px: root mean square reprojection error in pixels of those that stayed.
    """

    observations: int
    dropped: int
    rmse_px: float


@dataclass(frozen=True, slots=True, eq=False)
class BundleResult:
    """Adjusted poses.

    Attributes:
        poses: (4, 4) T_world_cam of every keyframe that was given.
        rounds: what each adjustment did; none where no landmark is seen often enough, or none is wanted.
        landmarks: how many landmarks were adjusted.
        held_out: what observations that took no part say; None where they are too few.
    """

    poses: dict[int, Transform]
    rounds: tuple[BundleRound, ...]
    landmarks: int
    held_out: HeldOut | None = None


def adjust(
    poses: Mapping[int, Transform],
    observations: Mapping[int, Observations],
    intrinsics: Intrinsics,
    config: BundleConfig,
    edges: Sequence[Edge] = (),
) -> BundleResult:
    """Adjust keyframes and landmarks together; the first keyframe stays where it is.

    Some observations take no part, and say afterwards whether the poses have become better. Keyframes whose
    observations are too many to take part are held by ``edges`` alone.

    Args:
        poses: (4, 4) T_world_cam to start from, by key.
        observations: landmarks seen, by key; keys without a pose are passed over.
        intrinsics: the camera; its distortion is not used, since observations are undistorted.
        config: weights and rounds.
        edges: odometry, accepted loops and what binds covisible keyframes. Odometry rests on the same observations,
            but on those of all frames between the keyframes too: without it the adjustment is less accurate on every
            sequence measured.

    Raises:
        GraphError: a pose is not a finite rigid transform, or the optimiser failed.
    """
    poses = {key: checked_pose(T, f"The pose of keyframe {key}") for key, T in poses.items()}
    observed = spread(poses, observations, intrinsics, config.min_views, config.max_covisible)
    if not len(observed) or not config.rounds:
        return BundleResult(poses, (), 0)
    observed = thinned(observed, config.max_observations)
    values = make_values(poses)
    for landmark, point in enumerate(observed.points):
        values.insert(gtsam.symbol("l", landmark), point)
    factors = _observation_factors(observed, intrinsics, config)
    held = _pose_factors(poses, edges, config.observation_share)
    held_out = choose(observed)
    kept = ~held_out
    rounds = []
    for _ in range(config.rounds):
        values = _adjusted(held, factors, kept, values, config.iterations)
        fresh = observed.moved(read_poses(values, poses), values)
        errors, depths = reprojection_errors(fresh, intrinsics, config.baseline)
        inside = (depths > 0) & (_whitened(errors, fresh, config) <= config.outlier)
        dropped = int((kept & ~inside).sum())
        rounds.append(BundleRound(int(kept.sum()), dropped, _rmse(errors[kept & inside])))
        kept &= inside
    adjusted = read_poses(values, poses)
    weights = np.array([1.0, 1.0, config.disparity_weight]) / config.pixel_sigma**2
    verdict = compare(observed, held_out, poses, adjusted, intrinsics, config.baseline, weights)
    return BundleResult(adjusted, tuple(rounds), len(observed.points), verdict)


def _adjusted(
    held: gtsam.NonlinearFactorGraph,
    factors: Sequence[gtsam.NonlinearFactor],
    kept: npt.NDArray[np.bool_],
    values: gtsam.Values,
    iterations: int,
) -> gtsam.Values:
    graph = gtsam.NonlinearFactorGraph(held)
    for index in np.flatnonzero(kept):
        graph.push_back(factors[int(index)])
    try:
        result = optimise(graph, values, iterations, TOLERANCE)
    except RuntimeError as error:  # GTSAM's own, such as an indeterminate system
        raise GraphError(f"The bundle could not be adjusted: {' '.join(str(error).split())}") from error
    if not np.isfinite(graph.error(result)):
        raise GraphError("The bundle could not be adjusted: the result is not finite.")
    return result


def _observation_factors(
    observed: ObservationTable, intrinsics: Intrinsics, config: BundleConfig
) -> list[gtsam.NonlinearFactor]:
    camera = (intrinsics.fx, intrinsics.fy, 0.0, intrinsics.cx, intrinsics.cy)
    stereo, mono = gtsam.Cal3_S2Stereo(*camera, config.baseline), gtsam.Cal3_S2(*camera)
    # Views of a landmark repeat its errors, so that together they count as one.
    sigmas = (observed.sigmas * np.sqrt(np.bincount(observed.landmarks))[observed.landmarks]).tolist()
    noises = {sigma: _noises(sigma, config) for sigma in set(sigmas)}
    right = observed.right_u(intrinsics, config.baseline).tolist()
    keys, landmarks = observed.keys.tolist(), observed.landmarks.tolist()
    factors: list[gtsam.NonlinearFactor] = []
    for i, (u, v) in enumerate(observed.pixels.tolist()):
        point = gtsam.symbol("l", landmarks[i])
        stereo_noise, mono_noise = noises[sigmas[i]]
        if observed.depths[i] > 0:
            pair = gtsam.StereoPoint2(u, right[i], v)
            factors.append(gtsam.GenericStereoFactor3D(pair, stereo_noise, keys[i], point, stereo, False, False))
        else:
            pixel_uv = np.array([u, v])
            factors.append(
                gtsam.GenericProjectionFactorCal3_S2(pixel_uv, mono_noise, keys[i], point, mono, False, False)
            )
    return factors


def _noises(sigma: float, config: BundleConfig) -> tuple[gtsam.noiseModel.Robust, gtsam.noiseModel.Robust]:
    """Noise of a stereo and of a monocular observation of a keypoint."""
    pixel = config.pixel_sigma * sigma
    kernel = gtsam.noiseModel.mEstimator.Huber.Create(HUBER_K)
    stereo = gtsam.noiseModel.Diagonal.Sigmas([pixel, pixel / np.sqrt(config.disparity_weight), pixel])
    mono = gtsam.noiseModel.Isotropic.Sigma(2, pixel)
    return gtsam.noiseModel.Robust.Create(kernel, stereo), gtsam.noiseModel.Robust.Create(kernel, mono)


def _pose_factors(
    poses: Mapping[int, Transform], edges: Sequence[Edge], observation_share: float
) -> gtsam.NonlinearFactorGraph:
    """The edges, tightened by as much as observations count less: so the outlier threshold stays in pixels."""
    graph = gtsam.NonlinearFactorGraph()
    for index, (key, T_world_cam) in enumerate(sorted(poses.items())):
        graph.add(prior_factor(key, T_world_cam, FLOATING_SIGMA if index else ANCHOR_SIGMA))
    for edge in edges:
        graph.add(between_factor(replace(edge, covariance=edge.covariance * observation_share)))
    return graph


def _whitened(errors: FloatArray, observed: ObservationTable, config: BundleConfig) -> FloatArray:
    weights = np.array([1.0, 1.0, config.disparity_weight])
    return np.asarray(np.sqrt((errors**2 * weights).sum(1)) / (config.pixel_sigma * observed.sigmas))


def _rmse(errors: FloatArray) -> float:
    return float(np.sqrt((errors[:, :2] ** 2).sum(1).mean())) if len(errors) else 0.0
