"""From a candidate to a constraint: a pose from features, refined on the clouds, behind gates."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from semslam.config import Config, VerificationConfig
from semslam.geometry.se3 import invert, orthonormalise
from semslam.loop.verification.free_space import free_space_violation
from semslam.loop.verification.gates import Gate, first_failed
from semslam.loop.verification.guess import FeaturePair, Guess, pose_from_nodes
from semslam.loop.verification.registration import Fit, Surface, measure_fit, plane_information, refine
from semslam.loop.verification.submaps import SubmapRegistration
from semslam.types import (
    Covariance6,
    FloatArray,
    Keyframe,
    LoopCandidate,
    LoopConstraint,
    LoopRejection,
    RejectionReason,
    Transform,
)

FITNESS_SLACK = 0.95
"""Share of the initial guess's fitness that ICP's pose must keep: the loss may trade some points for a better fit."""
ASSURED = 1.5
"""Times ``min_inliers`` that must agree on a predicted pose, or the guesses without prediction are made as well."""
ROTATION_GROWTH, TRANSLATION_GROWTH = 0.5, 1.5
"""Powers of the overlap that errors grow with as it falls, fitted to ground truth on two real sequences."""
MIN_SEEN = 0.05
"""Overlap below which they grow no more; the gates refuse such loops."""


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """Two keyframes, their features and their clouds: the query's is the source."""

    query: Keyframe
    match: Keyframe
    features: FeaturePair
    source: Surface
    target: Surface

    @classmethod
    def of(cls, query: Keyframe, match: Keyframe, config: VerificationConfig) -> Self:
        return cls(query, match, FeaturePair(query, match, config), Surface(query.cloud), Surface(match.cloud))


@dataclass(frozen=True, slots=True, eq=False)
class _Estimate:
    """A refined relative pose, and what the gates test of it.

    Attributes:
        T_match_query: (4, 4).
        covariance: (6, 6) of it.
        fit: the query's cloud on the match's.
        overlap: the smaller share of either cloud that lies near the other, 0..1.
    """

    T_match_query: Transform
    covariance: Covariance6
    fit: Fit
    overlap: float


class IcpVerifier:
    """Initial guesses from features and from semantic nodes, ICP, and gates that test the result.

    PnP RANSAC on feature matches, and the rigid motion of matched semantic nodes, each give an initial guess of the
    query's pose. From there features are matched anew near where they are predicted, also after ICP; the guess that
    most features agree on is kept. ICP on the keyframes' clouds then refines it, unless its pose fits the clouds worse
    or moves the agreeing features far, as where a view holds one plane. A constraint needs enough agreeing features,
    fitness, a small residual, overlap seen from both sides, no points in space that the other view looked through, and
    a position that is determined.

    A candidate with a guess of its own joins submaps, and their merged clouds are registered instead, since views from
    opposite sides share no feature.
    """

    name = "icp"

    def __init__(self, config: VerificationConfig, seed: int) -> None:
        self._config = config
        self._seed = seed
        self._submaps = SubmapRegistration(config.submaps)

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the section ``verification`` and the seed."""
        return cls(config.verification, config.seed)

    def verify(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> LoopConstraint | LoopRejection:
        """See ``LoopVerifier``; the reason, value and limit of a rejection are those of the first gate that failed."""
        if candidate.guess is not None:
            return self._submaps.verify(query, match, candidate, candidate.guess)
        pair = _Pair.of(query, match, self._config)
        guess, figures = self._best_guess(pair, candidate)
        found, limit = _count(guess), self._config.min_inliers
        if guess is None or found < limit:
            matches = len(pair.features.matches)
            if matches < limit:
                return LoopRejection(candidate, RejectionReason.FEW_MATCHES, matches, limit)
            return LoopRejection(candidate, RejectionReason.FEW_INLIERS, found, limit)
        smaller = min(len(query.cloud), len(match.cloud))
        if smaller < self._config.min_points:
            return LoopRejection(candidate, RejectionReason.NO_CLOUD, smaller, self._config.min_points)
        T_match_query, fit, method = self._refine(pair, guess)
        overlap = self._overlap(pair, T_match_query)
        covariance = self._covariance(query, match, guess, T_match_query, fit, method, overlap)
        failed = first_failed(self._gates(query, match, _Estimate(T_match_query, covariance, fit, overlap)))
        if failed is not None:
            return LoopRejection(candidate, failed.reason, failed.value, failed.limit)
        return LoopConstraint(
            candidate, T_match_query, covariance, fit.fitness, fit.rmse, overlap, found, method, figures,
            shared=pair.features.rows(guess.matches),
        )  # fmt: skip

    def _best_guess(self, pair: _Pair, candidate: LoopCandidate) -> tuple[Guess | None, dict[str, float]]:
        """The guess that most features agree on, and how many agreed on each."""
        config, features = self._config, pair.features
        figures: dict[str, float] = {}
        best: Guess | None = None
        if candidate.prediction is not None:
            best = features.support(candidate.prediction, "prediction")
            figures["prediction_guess"] = float(_count(best))
            if _count(best) >= ASSURED * config.min_inliers:
                return best, figures
        for source, T in self._starts(pair, candidate, figures):
            guess = features.support(T, source)
            if _count(guess) < config.min_inliers and _count(best) < config.min_inliers:
                T_icp = orthonormalise(refine(pair.source, pair.target, T, config.search_distances, config.icp))
                guess = max(guess, features.support(T_icp, source), key=_count)
            figures[f"{source}_guess"] = float(_count(guess))
            best = max(best, guess, key=_count)
        return best, figures

    def _starts(
        self, pair: _Pair, candidate: LoopCandidate, figures: dict[str, float]
    ) -> Iterator[tuple[str, Transform]]:
        """Poses from matched features and from matched nodes, and what each began with."""
        pnp = pair.features.solve(self._seed)
        if pnp is not None and pnp.inliers.sum() >= self._config.min_first_inliers:
            figures["first_inliers"] = float(pnp.inliers.sum())
            yield "features", pnp.T_ref_cam
        nodes = pose_from_nodes(candidate.evidence.nodes, pair.query.intrinsics, pair.match.intrinsics)
        if nodes is not None:
            figures["matched_nodes"] = float(nodes[1])
            yield "nodes", nodes[0]

    def _refine(self, pair: _Pair, guess: Guess) -> tuple[Transform, Fit, str]:
        """The better of the two poses, how it fits, and its name."""
        config, T_pnp = self._config, guess.T_match_query
        T_icp = orthonormalise(refine(pair.source, pair.target, T_pnp, config.icp_distances, config.icp))
        fit_pnp, fit_icp = (measure_fit(pair.source, pair.target, T, config.fit_distance) for T in (T_pnp, T_icp))
        fits = fit_icp.fitness >= FITNESS_SLACK * fit_pnp.fitness
        if fits and np.median(pair.features.errors(guess.matches, T_icp)) <= config.max_shift:
            return T_icp, fit_icp, "icp"
        return T_pnp, fit_pnp, "pnp"

    def _covariance(
        self, query: Keyframe, match: Keyframe, guess: Guess, T_match_query: Transform, fit: Fit, method: str,
        overlap: float,
    ) -> FloatArray:  # fmt: skip
        """Covariance (6, 6) of T_match_query: formal ones of the parts, widened to what ground truth shows."""
        config = self._config
        covariance: Covariance6 = config.pnp_inflation * guess.covariance
        if method == "icp":
            planes = plane_information(query.cloud, match.cloud, T_match_query, fit.pairs)
            noise = config.icp_inflation * max(fit.rmse, 1e-3) ** 2
            covariance = np.asarray(np.linalg.inv(np.linalg.inv(covariance) + planes / noise))
        seen = max(overlap, MIN_SEEN)
        sigmas = config.sigma_rotation / seen**ROTATION_GROWTH, config.sigma_translation / seen**TRANSLATION_GROWTH
        floor = np.repeat(sigmas, 3) ** 2
        covariance = covariance + np.diag(floor)
        return (covariance + covariance.T) / 2

    def _overlap(self, pair: _Pair, T_match_query: Transform) -> float:
        """The smaller of the shares of either cloud that the other one meets."""
        distance = self._config.overlap_distance
        there = measure_fit(pair.source, pair.target, T_match_query, distance)
        back = measure_fit(pair.target, pair.source, invert(T_match_query), distance)
        return min(there.fitness, back.fitness)

    def _gates(self, query: Keyframe, match: Keyframe, estimate: _Estimate) -> tuple[Gate, ...]:
        config, fit, overlap = self._config, estimate.fit, estimate.overlap
        filled = max(
            free_space_violation(query.cloud, match.cloud, match.intrinsics, estimate.T_match_query),
            free_space_violation(match.cloud, query.cloud, query.intrinsics, invert(estimate.T_match_query)),
        )
        sigma = float(np.sqrt(np.linalg.eigvalsh(estimate.covariance[3:, 3:])[-1]))
        return (
            Gate(fit.fitness >= config.min_fitness, RejectionReason.LOW_FITNESS, fit.fitness, config.min_fitness),
            Gate(fit.rmse <= config.max_rmse, RejectionReason.HIGH_RMSE, fit.rmse, config.max_rmse),
            Gate(overlap >= config.min_overlap, RejectionReason.LOW_OVERLAP, overlap, config.min_overlap),
            Gate(filled <= config.max_free_space, RejectionReason.FREE_SPACE, filled, config.max_free_space),
            Gate(sigma <= config.max_sigma, RejectionReason.DEGENERATE, sigma, config.max_sigma),
        )


def _count(guess: Guess | None) -> int:
    return 0 if guess is None else len(guess.matches)
