"""Loop candidates as data for the page's script: table rows and details."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from semslam.eval.looks import LOOKS, look_of
from semslam.eval.report.curves import dash_of, numbers
from semslam.eval.report.drawing import RunDrawing, loop_ends, paths, plane
from semslam.geometry.se3 import rotation_angle
from semslam.types import FloatArray, LedgerEntry

Values = list[tuple[str, str]]
Group = tuple[str, Values]
REASONS = {
    "redundant": "repeats loops of neighbouring keyframes",
    "few_matches": "few matches",
    "few_inliers": "few inliers",
    "no_cloud": "no point cloud",
    "far_from_guess": "far from the guess",
    "low_fitness": "low fitness",
    "high_rmse": "high RMSE",
    "low_overlap": "low overlap",
    "free_space": "free space violated",
    "degenerate": "degenerate geometry",
    "inconsistent": "contradicts odometry",
    "ambiguous": "ambiguous",
    "unsupported": "too few loops join the maps",
    "outlier": "outlier in the graph",
    "shed": "not verified: loop closing was behind",
}


@dataclass(frozen=True, slots=True)
class KindOfLoop:
    """One kind of candidates: name, legend, colour, dash and count."""

    name: str
    label: str
    color: str
    dash: str
    in_graph: bool
    count: int


@dataclass(frozen=True, slots=True)
class Candidate:
    """One candidate, as data for the script.

    Attributes:
        query: keyframe id.
        match: keyframe id.
        times: seconds of query and match since the start.
        detector: who proposed it.
        score: 0..1.
        kind: what became of it.
        reason: why, in words; empty where it simply passed.
        inliers: feature matches behind the pose, or None.
        error: centimetres from the true relative pose, or None.
        ends: positions of query and match in the plane of the view.
        groups: all that is known of it, as it is printed.
        nodes: label, then pixels u, v in the query and u, v in the match.
        matches: pixels u, v in the query and u, v in the match of the inliers that are drawn.
    """

    query: int
    match: int
    times: tuple[float, float]
    detector: str
    score: float
    kind: str
    reason: str
    inliers: int | None
    error: float | None
    ends: list[Any]
    groups: list[Group]
    nodes: list[list[Any]]
    matches: list[Any]


def kinds_of(loops: Sequence[LedgerEntry]) -> list[KindOfLoop]:
    """The kinds of candidates."""
    counts = {look: sum(look_of(loop) is look for loop in loops) for look in LOOKS}
    return [
        KindOfLoop(look.name, look.label, look.color, dash_of(look.line), look.is_in_graph, count)
        for look, count in counts.items()
        if count
    ]


def candidates_of(run: RunDrawing, inliers: Mapping[int, FloatArray]) -> list[Candidate]:
    """All candidates of an aligned run.

    Args:
        run: what is drawn.
        inliers: (K, 4) pixels by position of the candidate.
    """
    if not run.loops:
        return []
    ends = loop_ends(run, run.loops)[:, :, plane([path.trajectory for path in paths(run)])]
    return [
        Candidate(
            query=loop.query,
            match=loop.match,
            times=(round(loop.query_time - run.start, 3), round(loop.match_time - run.start, 3)),
            detector=loop.detector,
            score=round(loop.score, 4),
            kind=look_of(loop).name,
            reason=reason_of(loop),
            inliers=loop.inliers,
            error=None if loop.truth is None else round(100 * loop.truth.translation_m, 2),
            ends=numbers(ends[index], 3),
            groups=list(_groups(loop)),
            nodes=[[node.label, *_pixels(node.query_uvd), *_pixels(node.match_uvd)] for node in loop.evidence.nodes],
            matches=numbers(inliers[index], 0) if index in inliers else [],
        )
        for index, loop in enumerate(run.loops)
    ]


def reason_of(loop: LedgerEntry) -> str:
    """Why a candidate was not accepted, with the value that failed."""
    if loop.reason is None:
        return ""
    words = REASONS.get(loop.reason, loop.reason)
    return words if loop.figure is None or loop.limit is None else f"{words}: {loop.figure:.3g}, limit {loop.limit:.3g}"


def _pixels(uvd: tuple[float, float, float]) -> tuple[int, int]:
    return round(uvd[0]), round(uvd[1])


def _groups(loop: LedgerEntry) -> Iterable[Group]:
    proposal: Values = [("detector", loop.detector), ("score", f"{loop.score:.4f}"), *_named(loop.evidence.figures)]
    if loop.evidence.labels:
        proposal.append(("shared classes", ", ".join(loop.evidence.labels)))
    if loop.evidence.nodes:
        proposal.append(("matched nodes", str(len(loop.evidence.nodes))))
    if loop.evidence.objects:
        proposal.append(("matched objects", ", ".join(pair.label for pair in loop.evidence.objects)))
    yield "Proposal", proposal
    verification = _verification(loop)
    if verification:
        yield "Verification", verification
    if loop.weight is not None:
        yield "Pose graph", [("weight", f"{loop.weight:.3f}"), *_contribution(loop)]
    if loop.truth is not None:
        error = f"{100 * loop.truth.translation_m:.1f} cm, {loop.truth.rotation_deg:.2f}°"
        yield "Ground truth", [("judgement", loop.truth.judgement.value), ("error of the relative pose", error)]


def _verification(loop: LedgerEntry) -> Values:
    values: Values = []
    if loop.method is not None:
        values.append(("method", loop.method))
    if loop.inliers is not None:
        values.append(("inliers", str(loop.inliers)))
    if loop.fitness is not None:
        values.append(("fitness", f"{loop.fitness:.3f}"))
    if loop.inlier_rmse_m is not None:
        values.append(("inlier RMSE", f"{1000 * loop.inlier_rmse_m:.1f} mm"))
    if loop.overlap is not None:
        values.append(("overlap", f"{loop.overlap:.3f}"))
    if loop.T_match_query is not None:
        pose = np.array(loop.T_match_query)
        distance, angle = np.linalg.norm(pose[:3, 3]), np.degrees(rotation_angle(pose[None]))[0]
        values.append(("relative pose", f"{distance:.3f} m, {angle:.1f}°"))
    return values + _named(loop.figures or {})


def _contribution(loop: LedgerEntry) -> Values:
    brought = loop.contribution
    if brought is None:
        return []
    values = [("tension", f"{brought.tension:.2f}"), ("keyframes move without it", f"{1000 * brought.shift_m:.2f} mm")]
    if brought.ate_gain_m is not None:
        values.append(("ATE without it", f"{1000 * brought.ate_gain_m:+.2f} mm"))
    return values


def _named(figures: Mapping[str, float]) -> Values:
    return [(name.replace("_", " "), f"{value:.4g}") for name, value in figures.items()]
