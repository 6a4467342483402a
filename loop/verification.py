"""From a candidate to a constraint: a pose from features, refined on the clouds, behind gates."""

from dataclasses import dataclass
from typing import Protocol, Self, runtime_checkable

import numpy as np

from loop.free_space import free_space_violation
from loop.registration import Fit, measure_fit, plane_information, refine
from semslam.config import Config, VerificationConfig
from semslam.features import PnpResult, match_descriptors, solve_pnp
from semslam.geometry import invert, orthonormalise, transform_points
from semslam.types import (
    FloatArray,
    IntArray,
    Keyframe,
    LoopCandidate,
    LoopConstraint,
    LoopRejection,
    RejectionReason,
)

FITNESS_SLACK = 0.95
"""Share of the first guess's fitness that ICP's pose must keep: the loss may trade some points for a better fit."""


@runtime_checkable
class LoopVerifier(Protocol):
    """Decides by geometry whether two keyframes show the same place, and from where. Deterministic for a seed."""

    def verify(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> LoopConstraint | LoopRejection:
        """The relative pose with its covariance, or the first test that failed."""


@dataclass(frozen=True, slots=True, eq=False)
class _Guess:
    """A pose that feature matches agree on."""

    pnp: PnpResult
    matches: IntArray  # (K, 2) query and match keypoints that agree


class IcpVerifier:
    """Feature matches give the pose (PnP RANSAC), ICP refines it, and gates test what comes out.

    The relative pose from features is the first guess of point-to-plane ICP on the keyframes' clouds. ICP's pose is
    kept unless it fits the clouds worse or moves the agreeing features far, as it does where a view holds one plane.
    A constraint needs enough agreeing features, fitness, a small residual, overlap seen from both sides, no points in
    space that the other view looked through, and a position that is determined.
    """

    def __init__(self, config: VerificationConfig, seed: int) -> None:
        self._config = config
        self._seed = seed

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the section ``verification`` and the seed."""
        return cls(config.verification, config.seed)

    def verify(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> LoopConstraint | LoopRejection:
        """See ``LoopVerifier``; the reason, figure and limit of a rejection are those of the first gate that closed."""
        guess = self._guess(query, match, candidate)
        if isinstance(guess, LoopRejection):
            return guess
        smaller = min(len(query.cloud), len(match.cloud))
        if smaller < self._config.min_points:
            return LoopRejection(candidate, RejectionReason.NO_CLOUD, smaller, self._config.min_points)
        T_match_query, fit, method = self._refine(query, match, guess)
        covariance = self._covariance(query, match, guess.pnp, T_match_query, fit, method)
        overlap = self._overlap(query, match, T_match_query)
        refusal = self._gate(query, match, candidate, T_match_query, fit, overlap, covariance)
        return refusal or LoopConstraint(
            candidate, T_match_query, covariance, fit.fitness, fit.rmse, overlap, len(guess.matches), method
        )

    def _guess(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> _Guess | LoopRejection:
        limit = self._config.min_inliers
        pairs = match_descriptors(query.features.descriptors, match.features.descriptors, self._config.match_ratio)
        pairs = pairs[match.features.depths[pairs[:, 1]] > 0]
        if len(pairs) < limit:
            return LoopRejection(candidate, RejectionReason.FEW_MATCHES, len(pairs), limit)
        pnp = solve_pnp(
            match.features.points[pairs[:, 1]], query.features.pixels[pairs[:, 0]], query.intrinsics,
            self._config.max_reprojection, self._seed,
        )  # fmt: skip
        inliers = 0 if pnp is None else int(pnp.inliers.sum())
        if pnp is None or inliers < limit:
            return LoopRejection(candidate, RejectionReason.FEW_INLIERS, inliers, limit)
        return _Guess(pnp, pairs[pnp.inliers])

    def _refine(self, query: Keyframe, match: Keyframe, guess: _Guess) -> tuple[FloatArray, Fit, str]:
        """The better of the two poses, how it fits, and its name."""
        config = self._config
        T_pnp = guess.pnp.T_ref_cam
        T_icp = orthonormalise(refine(query.cloud, match.cloud, T_pnp, config.icp_distances))
        fit_pnp, fit_icp = (measure_fit(query.cloud, match.cloud, T, config.fit_distance) for T in (T_pnp, T_icp))
        fits = fit_icp.fitness >= FITNESS_SLACK * fit_pnp.fitness
        if fits and self._shift(query, match, guess.matches, T_icp) <= config.max_shift:
            return T_icp, fit_icp, "icp"
        return T_pnp, fit_pnp, "pnp"

    def _shift(self, query: Keyframe, match: Keyframe, matches: IntArray, T_match_query: FloatArray) -> float:
        """Median reprojection error in pixels of the agreeing features under another pose."""
        points = transform_points(invert(T_match_query), match.features.points[matches[:, 1]])
        if (points[:, 2] <= 0).any():
            return float("inf")
        errors = query.intrinsics.project(points) - query.features.pixels[matches[:, 0]]
        return float(np.median(np.linalg.norm(errors, axis=1)))

    def _covariance(
        self, query: Keyframe, match: Keyframe, pnp: PnpResult, T_match_query: FloatArray, fit: Fit, method: str
    ) -> FloatArray:
        """Covariance (6, 6) of T_match_query: formal ones of the parts, widened to what ground truth shows."""
        config = self._config
        covariance: FloatArray = config.pnp_inflation * pnp.covariance
        if method == "icp":
            planes = plane_information(query.cloud, match.cloud, T_match_query, fit.pairs)
            noise = config.icp_inflation * max(fit.rmse, 1e-3) ** 2
            covariance = np.asarray(np.linalg.inv(np.linalg.inv(covariance) + planes / noise))
        floor = np.repeat([config.sigma_rotation, config.sigma_translation], 3) ** 2
        covariance = covariance + np.diag(floor)
        return (covariance + covariance.T) / 2

    def _overlap(self, query: Keyframe, match: Keyframe, T_match_query: FloatArray) -> float:
        """The smaller of the shares of either cloud that the other one meets."""
        distance = self._config.overlap_distance
        there = measure_fit(query.cloud, match.cloud, T_match_query, distance)
        back = measure_fit(match.cloud, query.cloud, invert(T_match_query), distance)
        return min(there.fitness, back.fitness)

    def _gate(
        self, query: Keyframe, match: Keyframe, candidate: LoopCandidate, T_match_query: FloatArray, fit: Fit,
        overlap: float, covariance: FloatArray,
    ) -> LoopRejection | None:  # fmt: skip
        config = self._config
        filled = max(
            free_space_violation(query.cloud, match.cloud, match.intrinsics, T_match_query),
            free_space_violation(match.cloud, query.cloud, query.intrinsics, invert(T_match_query)),
        )
        sigma = float(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:])[-1]))
        gates = (
            (fit.fitness >= config.min_fitness, RejectionReason.LOW_FITNESS, fit.fitness, config.min_fitness),
            (fit.rmse <= config.max_rmse, RejectionReason.HIGH_RMSE, fit.rmse, config.max_rmse),
            (overlap >= config.min_overlap, RejectionReason.LOW_OVERLAP, overlap, config.min_overlap),
            (filled <= config.max_free_space, RejectionReason.FREE_SPACE, filled, config.max_free_space),
            (sigma <= config.max_sigma, RejectionReason.DEGENERATE, sigma, config.max_sigma),
        )
        for passed, reason, figure, limit in gates:
            if not passed:
                return LoopRejection(candidate, reason, figure, limit)
        return None
