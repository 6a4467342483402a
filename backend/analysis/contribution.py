"""What each accepted loop brought: the graph with and without it."""

from collections.abc import Iterator
from dataclasses import dataclass

import gtsam
import numpy as np

from semslam.backend.graph.factors import (
    ANCHOR_SIGMA,
    FLOATING_SIGMA,
    between_factor,
    make_values,
    prior_factor,
    read_poses,
)
from semslam.backend.graph.products import GraphSolution
from semslam.backend.robust.least_squares import optimise
from semslam.config import BackendConfig
from semslam.errors import GraphError
from semslam.types import LoopConstraint, Transform

HOLD_SIGMA = 10.0
"""Radians and metres: keeps a part that only one loop joins to the rest determined when that loop is left out."""


@dataclass(frozen=True, slots=True, eq=False)
class Contribution:
    """One accepted loop, left out.

    Attributes:
        constraint: the loop.
        tension: squared Mahalanobis distance that the other measurements gain when it goes; about 6 where it agrees
            with them, large where it pulls against them.
        shift_m: root mean square movement of the keyframes without it; a loop that others back up moves little.
        poses: (4, 4) T_world_cam by key without it, so that an error can be taken against ground truth.
        poses_with: the same with it.
    """

    constraint: LoopConstraint
    tension: float
    shift_m: float
    poses: dict[int, Transform]
    poses_with: dict[int, Transform]


def leave_one_out(solution: GraphSolution, config: BackendConfig) -> Iterator[Contribution]:
    """The graph without each accepted loop in turn, in the order of the verdicts.

    The whole graph is optimised first; from there one Gauss-Newton step of the others leads to where they would be.

    Raises:
        GraphError: the optimiser failed.
    """
    accepted = [verdict.constraint for verdict in solution.verdicts if verdict.accepted]
    factors = _factors(solution)
    offset = len(factors) - len(accepted)
    values = optimise(_graph(factors), make_values(solution.poses), config.max_iterations)
    whole, poses_with = 2.0 * _graph(factors).error(values), read_poses(values, solution.poses)
    linear = [factor.linearize(values) for factor in factors]
    for index, constraint in enumerate(accepted):
        left_out = offset + index
        step = _solved(_linear_graph([*linear[:left_out], *linear[left_out + 1 :]]))
        without = values.retract(step)
        poses = read_poses(without, solution.poses)
        tension = whole - 2.0 * _graph([*factors[:left_out], *factors[left_out + 1 :]]).error(without)
        yield Contribution(constraint, tension, _shift(poses, poses_with), poses, poses_with)


def _factors(solution: GraphSolution) -> list[gtsam.NonlinearFactor]:
    """Covisible keyframes, anchors, odometry, then the accepted loops."""
    firm = solution.anchors[0]
    factors: list[gtsam.NonlinearFactor] = [
        prior_factor(key, solution.poses[key], ANCHOR_SIGMA if key == firm else FLOATING_SIGMA)
        for key in solution.anchors
    ]
    factors += [prior_factor(key, pose, HOLD_SIGMA) for key, pose in solution.poses.items()]
    return [*map(between_factor, solution.covisible), *factors, *map(between_factor, solution.widened)]


def _graph(factors: list[gtsam.NonlinearFactor]) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph()
    for factor in factors:
        graph.push_back(factor)
    return graph


def _linear_graph(factors: list[gtsam.GaussianFactor]) -> gtsam.GaussianFactorGraph:
    graph = gtsam.GaussianFactorGraph()
    for factor in factors:
        graph.push_back(factor)
    return graph


def _solved(graph: gtsam.GaussianFactorGraph) -> gtsam.VectorValues:
    """The step of a linear graph; by QR where a part that nothing else holds leaves it too badly conditioned otherwise.

    Raises:
        GraphError: neither solves it.
    """
    try:
        return graph.optimize()
    except RuntimeError:  # GTSAM's own: an indeterminate system
        try:
            return graph.optimize(gtsam.EliminateQR)
        except RuntimeError as error:
            raise GraphError(
                f"The graph cannot be solved without one of its loops: {' '.join(str(error).split())}"
            ) from error


def _shift(poses: dict[int, Transform], reference: dict[int, Transform]) -> float:
    moved = np.stack([poses[key][:3, 3] - reference[key][:3, 3] for key in reference])
    return float(np.sqrt((moved**2).sum(1).mean()))
