"""Registration of two submaps, each the clouds of several keyframes, from a detector's guess."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semslam.config import SubmapConfig
from semslam.geometry.reprojection import retract
from semslam.geometry.se3 import FloatArray, invert, orthonormalise, rotation_angle, tangent, transform_points
from semslam.geometry.voxels import voxel_keys
from semslam.loop.verification.anchors import Anchors, choose_anchors
from semslam.loop.verification.free_space import BoolArray, sight_of
from semslam.loop.verification.gates import Gate, first_failed
from semslam.loop.verification.registration import Fit, Surface, measure_fit, plane_information, refine
from semslam.types import Cloud, Keyframe, LoopCandidate, LoopConstraint, LoopRejection, RejectionReason, SubmapGuess


def ends_of(candidate: LoopCandidate, keyframes: Sequence[Keyframe]) -> tuple[Keyframe, Keyframe]:
    """Query and match of a candidate, each with its submap around it where the candidate has a guess.

    Args:
        candidate: names both.
        keyframes: all so far; ``keyframes[i].id`` is i.
    """
    query, match, guess = keyframes[candidate.query], keyframes[candidate.match], candidate.guess
    if guess is None:
        return query, match
    return _with_submap(query, guess.query, keyframes), _with_submap(match, guess.match, keyframes)


def _with_submap(keyframe: Keyframe, ids: Sequence[int], keyframes: Sequence[Keyframe]) -> Keyframe:
    return replace(keyframe, around=tuple(keyframes[i] for i in ids if i != keyframe.id))


def merged_cloud(keyframe: Keyframe, voxel: float) -> Cloud:
    """The clouds of a keyframe and those around it, by odometry, in its camera frame; one point for each voxel.

    A voxel's point and normal are the means of those in it.
    """
    parts = (keyframe, *keyframe.around)
    poses = [invert(keyframe.T_odom_cam) @ part.T_odom_cam for part in parts]
    points = np.concatenate([transform_points(T, part.cloud.points) for T, part in zip(poses, parts, strict=True)])
    normals = np.concatenate([part.cloud.normals @ T[:3, :3].T for T, part in zip(poses, parts, strict=True)])
    _, owner, counts = np.unique(voxel_keys(points, voxel), return_inverse=True, return_counts=True)
    means = [
        np.stack([np.bincount(owner, values[:, k], len(counts)) for k in range(3)], 1) / counts[:, None]
        for values in (points, normals)
    ]
    lengths = np.linalg.norm(means[1], axis=1)
    kept = lengths > 0.5  # both sides of a thin board in one voxel have no normal
    return Cloud(
        means[0][kept].astype(np.float32),
        (means[1][kept] / lengths[kept, None]).astype(np.float32),
    )


class SubmapRegistration:
    """From a guess between two submaps to a constraint: ICP on the merged clouds, coarse to fine, behind gates.

    The submaps need enough points, a registration that stays near the guess, an overlap that is large from both sides,
    and few points in space that any view of the other submap looked through. Of the keyframes in them, the two that
    share most surface are then registered again with their neighbours alone, and the constraint is between these: a
    submap is as straight as odometry was while it was seen. Both registrations count by their covariances, so that
    along a corridor, which its walls leave open, the submaps decide. This needs to stay near the first registration,
    an overlap, a small residual and a position that is determined. Only surfaces that face the same way are laid onto
    one another. Nothing in it compares appearance.
    """

    def __init__(self, config: SubmapConfig) -> None:
        self._config = config
        self._bent = np.diag(np.repeat((config.bent_rotation, config.bent_translation), 3) ** 2)
        self._systematic = np.diag(np.repeat((config.sigma_rotation, config.sigma_translation), 3) ** 2)

    def verify(
        self, query: Keyframe, match: Keyframe, candidate: LoopCandidate, guess: SubmapGuess
    ) -> LoopConstraint | LoopRejection:
        """Register the submaps around two keyframes; the rejection names the first gate that failed."""
        config = self._config
        ours, theirs = merged_cloud(query, config.voxel), merged_cloud(match, config.voxel)
        smaller = min(len(ours), len(theirs))
        if smaller < config.min_points:
            return LoopRejection(candidate, RejectionReason.NO_CLOUD, smaller, config.min_points)
        T_guess = np.array(guess.T_match_query)
        source, target = Surface(ours), Surface(theirs)
        T = orthonormalise(refine(source, target, T_guess, config.distances, by_normals=True))
        there = measure_fit(source, target, T, config.near, by_normals=True)
        back = measure_fit(target, source, invert(T), config.near, by_normals=True)
        overlap = min(there.fitness, back.fitness)
        filled = max(_free_space_share(ours, there, match, T), _free_space_share(theirs, back, query, invert(T)))
        # The less both have seen in common, the surer must be what there is.
        limit = config.max_free_space if overlap >= config.much_overlap else config.max_free_space_little
        gates = (
            self._stays(T_guess, T, config.max_shift),
            Gate(overlap >= config.min_overlap, RejectionReason.LOW_OVERLAP, overlap, config.min_overlap),
            Gate(filled <= limit, RejectionReason.FREE_SPACE, filled, limit),
        )
        failed = first_failed(gates)
        if failed is not None:
            return LoopRejection(candidate, failed.reason, failed.value, failed.limit)
        figures = {f"submaps_{gate.reason.value}": gate.value for gate in gates}
        return self._join(choose_anchors(query, match, T), candidate, figures)

    def _join(
        self, anchors: Anchors, candidate: LoopCandidate, figures: dict[str, float]
    ) -> LoopConstraint | LoopRejection:
        """Register the two keyframes that share most surface, with their neighbours."""
        config = self._config
        ours, theirs = (merged_cloud(end, config.voxel) for end in (anchors.query, anchors.match))
        source, target = Surface(ours), Surface(theirs)
        T_views = orthonormalise(refine(source, target, anchors.T_match_query, config.distances[1:], by_normals=True))
        fit = measure_fit(source, target, T_views, config.fit_distance, by_normals=True)
        found = self._covariance(ours, theirs, T_views, fit)
        T, covariance = _determined(anchors.T_match_query, self._bent, T_views, found)
        fit = measure_fit(source, target, T, config.fit_distance, by_normals=True)
        there = measure_fit(source, target, T, config.near, by_normals=True)
        back = measure_fit(target, source, invert(T), config.near, by_normals=True)
        overlap = min(there.fitness, back.fitness)
        sigma = float(np.sqrt(np.linalg.eigvalsh((found + self._systematic)[3:, 3:])[-1]))
        gates = (
            self._stays(anchors.T_match_query, T, config.max_view_shift),
            Gate(overlap >= config.min_view_overlap, RejectionReason.LOW_OVERLAP, overlap, config.min_view_overlap),
            Gate(fit.rmse <= config.max_rmse, RejectionReason.HIGH_RMSE, fit.rmse, config.max_rmse),
            Gate(sigma <= config.max_sigma, RejectionReason.DEGENERATE, sigma, config.max_sigma),
        )
        failed = first_failed(gates)
        if failed is not None:
            return LoopRejection(candidate, failed.reason, failed.value, failed.limit)
        return LoopConstraint(
            candidate,
            T,
            covariance + self._systematic,
            fit.fitness,
            fit.rmse,
            overlap,
            len(candidate.evidence.objects),
            "submaps",
            figures | {gate.reason.value: gate.value for gate in gates},
            between=(anchors.query.id, anchors.match.id),
        )

    def _stays(self, T_guess: FloatArray, T: FloatArray, max_shift: float) -> Gate:
        """Whether a registration stays near what it began with."""
        change = invert(T_guess) @ T
        moved = float(np.linalg.norm(change[:3, 3]))
        stayed = moved <= max_shift and float(rotation_angle(change)) <= self._config.max_turn
        return Gate(stayed, RejectionReason.FAR_FROM_GUESS, moved, max_shift)

    def _covariance(self, ours: Cloud, theirs: Cloud, T: FloatArray, fit: Fit) -> FloatArray:
        """Covariance (6, 6) of T: that of point-to-plane ICP, inflated."""
        config = self._config
        planes = plane_information(ours, theirs, T, fit.pairs)
        noise = config.inflation * max(fit.rmse, 1e-3) ** 2
        covariance: FloatArray = np.asarray(np.linalg.inv(planes / noise + 1e-6 * np.eye(6)))
        return (covariance + covariance.T) / 2


def _determined(
    T: FloatArray, covariance: FloatArray, other: FloatArray, other_covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Go from a pose to another one in the directions in which that is the surer one, and their covariance (6, 6).

    Remapping as by Zhang, Kaess and Singh (ICRA 2016): what is hardly determined is no reason to move.
    """
    root = np.linalg.cholesky(covariance)
    whitened = np.linalg.solve(root, np.linalg.solve(root, other_covariance).T)
    ratios, directions = np.linalg.eigh((whitened + whitened.T) / 2)
    basis = root @ directions
    step = np.linalg.solve(basis, tangent(invert(T) @ other))
    both = (basis * np.minimum(ratios, 1.0)) @ basis.T
    return orthonormalise(retract(T, basis @ np.where(ratios < 1.0, step, 0.0))), (both + both.T) / 2


def _free_space_share(seen: Cloud, fit: Fit, looking: Keyframe, T_looking_seen: FloatArray) -> float:
    """Points in free space of any view of a submap, as a share of these and of the points that meet its surface."""
    near: BoolArray = np.zeros(len(seen), dtype=bool)
    near[fit.pairs[:, 0]] = True
    blocked: BoolArray = np.zeros(len(seen), dtype=bool)
    for part in (looking, *looking.around):
        T_part_seen = invert(part.T_odom_cam) @ looking.T_odom_cam @ T_looking_seen
        blocked |= sight_of(seen, part.cloud, part.intrinsics, T_part_seen).blocked
    blocked &= ~near
    return float(blocked.sum() / max(blocked.sum() + near.sum(), 1))
