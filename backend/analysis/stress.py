"""False loops added to a graph that is known to be good, to measure which strategies reject them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from semslam.backend.analysis.judge import constraint_of, rebuilt, split_edges
from semslam.backend.graph.chain import OdometryChain
from semslam.backend.graph.products import Edge, GraphSolution, PosedGraph
from semslam.config import BackendConfig
from semslam.errors import ConfigError, GraphError
from semslam.geometry.se3 import exp_so3, invert, make_transform
from semslam.types import FloatArray, LoopConstraint, Transform

GROUP = 6
"""False loops in one consistent group."""
MIN_GAP = 10
"""Keyframes that must lie between the ends of a false loop."""
SPREAD_RAD, SPREAD_M = 0.3, 0.5
"""Deviations of the relative pose that a false loop claims; it claims to see the same place from nearby."""
ATTEMPTS = 1000


class FalseLoopKind(StrEnum):
    """How false loops relate to one another."""

    RANDOM = "random"
    CONSISTENT = "consistent"


@dataclass(frozen=True, slots=True)
class Attack:
    """False loops to be added to a graph.

    Attributes:
        share: false ones among all loops, 0 to below 1.
        kind: unrelated to one another, or groups of consistent ones, as between places that look alike.
        seed: of the false loops.

    Raises:
        ConfigError: the share is out of range.
    """

    share: float
    kind: FalseLoopKind = FalseLoopKind.RANDOM
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.share < 1:
            raise ConfigError(f"The share of false loops must lie between 0 and 1, not {self.share}.")


@dataclass(frozen=True, slots=True, eq=False)
class StressOutcome:
    """What false loops did to one strategy.

    Attributes:
        attack: the false loops.
        name: the strategy.
        clean: the solution without them.
        stressed: the solution with them; its poses are what an ATE is to be taken of.
        true_kept: share of the graph's own loops that stayed accepted, 0..1.
        false_kept: share of the false ones that were accepted, 0..1.
    """

    attack: Attack
    name: str
    clean: GraphSolution
    stressed: GraphSolution
    true_kept: float
    false_kept: float


def stress(
    graph: PosedGraph,
    attacks: Sequence[Attack],
    strategies: Sequence[str],
    config: BackendConfig | None = None,
) -> tuple[StressOutcome, ...]:
    """Optimise a good graph with injected false loops, by each strategy and from odometry alone.

    Args:
        graph: optimised poses, odometry and loops that are taken for true.
        attacks: the false loops, one set after the other.
        strategies: registered names of robust strategies.
        config: limits of the optimisation.

    Returns:
        An outcome per attack and strategy, those of one attack side by side.

    Raises:
        GraphError: the graph has no loop, or is too small for false ones.
    """
    odometry, loops = split_edges(graph)
    if not loops:
        raise GraphError("The graph has no loop, so there is nothing to put under stress.")
    start, settings = _by_odometry(graph, odometry), config or BackendConfig()
    own = [constraint_of(edge) for edge in loops]

    def solve(name: str, chosen: Sequence[LoopConstraint]) -> GraphSolution:
        limits = settings.model_copy(update={"robust": name})
        return rebuilt(start, odometry, chosen, graph.anchors, limits).optimize()

    clean = {name: solve(name, own) for name in strategies}
    outcomes = []
    for attack in attacks:
        count = round(len(loops) * attack.share / (1 - attack.share))
        false = [constraint_of(edge, "injected") for edge in false_loops(graph, count, attack.kind, attack.seed)]
        for name in strategies:
            stressed = solve(name, [*own, *false])
            accepted = np.array([verdict.accepted for verdict in stressed.verdicts], dtype=bool)
            kept = _share(accepted[: len(own)], 1.0), _share(accepted[len(own) :], 0.0)
            outcomes.append(StressOutcome(attack, name, clean[name], stressed, *kept))
    return tuple(outcomes)


def false_loops(graph: PosedGraph, count: int, kind: FalseLoopKind, seed: int) -> tuple[Edge, ...]:
    """Invent loops between keyframes that are elsewhere, with covariances borrowed from the graph's own loops.

    Raises:
        GraphError: the graph is too small to hold so many.
    """
    rng = np.random.default_rng(seed)
    _, loops = split_edges(graph)
    keys = sorted(graph.poses)
    taken = {(edge.from_key, edge.to_key) for edge in loops}
    false: list[Edge] = []
    for _ in range(ATTEMPTS * max(count, 1)):
        if len(false) >= count:
            return tuple(false[:count])
        length = min(GROUP, count - len(false)) if kind is FalseLoopKind.CONSISTENT else 1
        for edge in _look_alike(graph, keys, loops, length, rng):
            if (edge.from_key, edge.to_key) not in taken:
                taken.add((edge.from_key, edge.to_key))
                false.append(edge)
    raise GraphError(f"The graph of {len(keys)} keyframes is too small for {count} false loops.")


def _look_alike(
    graph: PosedGraph, keys: Sequence[int], loops: Sequence[Edge], length: int, rng: np.random.Generator
) -> Iterator[Edge]:
    """Loops from ``length`` keyframes in a row to as many elsewhere, all claiming the same move of the place."""
    if len(keys) < 2 * length + MIN_GAP:
        return
    first = int(rng.integers(0, len(keys) - 2 * length - MIN_GAP + 1))
    second = int(rng.integers(first + length + MIN_GAP, len(keys) - length + 1))
    claimed = make_transform(exp_so3(rng.normal(size=3) * SPREAD_RAD), rng.normal(size=3) * SPREAD_M)
    true = invert(graph.poses[keys[first]]) @ graph.poses[keys[second]]
    if np.linalg.norm(true[:3, 3] - claimed[:3, 3]) < 2 * SPREAD_M:
        return  # by chance not far from the truth
    moved = graph.poses[keys[first]] @ claimed @ invert(graph.poses[keys[second]])
    for match, query in zip(keys[first : first + length], keys[second : second + length], strict=True):
        covariance = loops[int(rng.integers(len(loops)))].covariance
        noise = np.linalg.cholesky(covariance) @ rng.normal(size=6)
        T_match_query = invert(graph.poses[match]) @ moved @ graph.poses[query]
        T_match_query = T_match_query @ make_transform(exp_so3(noise[:3]), noise[3:])
        yield Edge(match, query, T_match_query, covariance)


def _by_odometry(graph: PosedGraph, odometry: Sequence[Edge]) -> dict[int, Transform]:
    """Poses as odometry alone has them; each chain starts where the graph has its first keyframe."""
    chain = OdometryChain(graph.poses, odometry)
    return {key: graph.poses[start] @ T_start_key for key, start, T_start_key in chain.poses()}


def _share(accepted: FloatArray, nothing: float) -> float:
    return float(accepted.mean()) if len(accepted) else nothing
