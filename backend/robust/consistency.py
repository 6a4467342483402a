"""Pairwise consistency maximisation (Mangelson et al., ICRA 2018): the largest set of loops that agree in pairs.

Two loops agree when the cycle through both and the odometry between their ends closes within its covariance.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from semslam.backend.graph.chain import OdometryChain, squared_mahalanobis
from semslam.backend.graph.products import Edge
from semslam.backend.robust.calibration import cycles

BoolMatrix = npt.NDArray[np.bool_]

PAIR_SLACK = 1.4
"""How much farther than a single loop a cycle may be off: a true loop must close one with every other."""
EXACT_STEPS = 20_000
"""Branches after which the search is content with the best set found."""
BLOCK = 50_000
"""Pairs that are worked on at a time."""


def consistent_loops(chain: OdometryChain, loops: Sequence[Edge], max_residual: float) -> npt.NDArray[np.bool_]:
    """Which loops belong to the largest pairwise consistent set, (L,).

    Loops between maps that odometry does not join are compared with loops between the same two maps; those that
    cannot be compared with one another are taken as agreeing.

    Args:
        chain: odometry.
        loops: edges to choose from.
        max_residual: Mahalanobis distance up to which a single loop counts as true.
    """
    chosen = np.zeros(len(loops), dtype=bool)
    chosen[largest_clique(agreement(chain, loops, max_residual))] = True
    return chosen


def agreement(chain: OdometryChain, loops: Sequence[Edge], max_residual: float) -> BoolMatrix:
    """Symmetric matrix (L, L): which loops agree in pairs."""
    count = len(loops)
    agree = np.ones((count, count), dtype=bool)
    first, second = np.triu_indices(count, 1)
    for begin in range(0, len(first), BLOCK):
        i, j = first[begin : begin + BLOCK], second[begin : begin + BLOCK]
        cycle = cycles(chain, loops, i, j)
        distances = squared_mahalanobis(cycle.errors, cycle.loops + cycle.odometry)
        agree[i, j] = agree[j, i] = (distances <= (PAIR_SLACK * max_residual) ** 2) | ~cycle.joined
    return agree


def largest_clique(adjacent: BoolMatrix) -> list[int]:
    """Indices of a largest set in which all are adjacent, ascending.

    Branch and bound with greedy colouring (Tomita and Seki, DMTCS 2003); exact unless it runs out of steps, which
    dense graphs of many hundreds of loops may, where the best set found until then is returned.
    """
    count = len(adjacent)
    if count == 0:
        return []
    adjacent = adjacent & ~np.eye(count, dtype=bool)
    neighbours = [frozenset(np.flatnonzero(row).tolist()) for row in adjacent]
    order = np.argsort(-adjacent.sum(1), kind="stable").tolist()
    best = _greedy(order, neighbours)
    steps = 0
    stack: list[tuple[list[int], list[int]]] = [([], order)]
    while stack and steps < EXACT_STEPS:
        steps += 1
        clique, candidates = stack.pop()
        if not candidates:
            if len(clique) > len(best):
                best = clique
            continue
        colours, ordered = _coloured(candidates, neighbours)
        # Highest colour last on the stack's top; a branch that cannot beat the best is never pushed.
        for place, vertex in enumerate(ordered):
            if len(clique) + colours[place] > len(best):
                stack.append(([*clique, vertex], [v for v in ordered[:place] if v in neighbours[vertex]]))
    return sorted(best)


def _greedy(order: Sequence[int], neighbours: Sequence[frozenset[int]]) -> list[int]:
    clique: list[int] = []
    for vertex in order:
        if neighbours[vertex].issuperset(clique):
            clique.append(vertex)
    return clique


def _coloured(candidates: Sequence[int], neighbours: Sequence[frozenset[int]]) -> tuple[list[int], list[int]]:
    """Colour numbers (from 1, ascending) and the candidates in that order; neighbours never share a colour."""
    classes: list[list[int]] = []
    for vertex in candidates:
        for members in classes:
            if neighbours[vertex].isdisjoint(members):
                members.append(vertex)
                break
        else:
            classes.append([vertex])
    colours = [colour for colour, members in enumerate(classes, 1) for _ in members]
    return colours, [vertex for members in classes for vertex in members]
