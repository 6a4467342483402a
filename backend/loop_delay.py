"""The delay of depth after colour, from loops: depth measured them, and the graph is of colour's instants.

A camera moves on between colour and depth, at either end of a loop in its own way. A loop that was registered by depth
is off by the difference of both velocities times the delay, which many loops determine together. Once it is known each
loop is taken to the instants of its colour images, with no registration done again.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from semslam.backend.graph.products import GraphSolution
from semslam.backend.pose_graph import PoseGraph
from semslam.geometry.se3 import adjoint, exp_so3, invert, make_transform, tangent
from semslam.types import FloatArray, LoopConstraint, Transform

ROUNDS = 6
"""Optimisations with corrected loops at most: the graph gives way to a delay that is still in it."""
KEPT = 0.9
"""Share of the accepted loops that a correction must keep: near the threshold some change sides by chance."""
FASTER = 4.0
"""Factor on a further correction at the most."""
SETTLED = 5e-4
"""Seconds of a further correction below which rounds end."""
FEWEST = 10
"""Loops below which nothing is said."""
CERTAIN = 4.0
"""Standard deviations that a delay must differ from none."""
SMALLEST, LARGEST = 2e-3, 0.06
"""Seconds of a delay that is worth correcting, and of one that is believed."""
STEPS, HUBER_K = 8, 1.5
BY_DEPTH = "icp"
"""Method of loops that were measured by depth."""


@dataclass(frozen=True, slots=True)
class LoopDelay:
    """A delay that loops determine.

    Attributes:
        seconds: by which depth is measured after colour, beyond what the camera states.
        sigma: standard deviation, seconds.
        loops: how many it rests on.
    """

    seconds: float
    sigma: float
    loops: int

    @property
    def is_certain(self) -> bool:
        """Whether it is one to correct."""
        return SMALLEST <= abs(self.seconds) <= LARGEST and abs(self.seconds) > CERTAIN * self.sigma

    @property
    def sentence(self) -> str:
        """What was found and done."""
        side = "after" if self.seconds > 0 else "before"
        return (
            f"Loops show that depth is measured {1000 * abs(self.seconds):.1f} ms {side} the instants that the camera "
            f"states (standard deviation {1000 * self.sigma:.1f} ms), and were corrected for it (delay in camera.yaml)."
        )


@dataclass(frozen=True, slots=True, eq=False)
class TimedSolution:
    """An optimised graph whose loops are of colour's instants.

    Attributes:
        solution: the graph.
        delay: by which its loops were corrected; None = by none.
    """

    solution: GraphSolution
    delay: LoopDelay | None = None


def optimize_at_color(graph: PoseGraph, velocities: Mapping[int, FloatArray]) -> TimedSolution:
    """Optimise a graph, and again with loops corrected for a delay, where they determine one and the loops fit it.

    Args:
        graph: keyframes, odometry and loops; it stays as it is.
        velocities: (6,) angular and linear of keyframes' cameras, radians and metres a second, where they are known.

    Raises:
        GraphError: the graph is empty or the optimiser failed.
    """
    solution, delay, last, same = graph.optimize(), None, 0.0, False
    needed = KEPT * len(solution.loops)
    for _ in range(ROUNDS):
        found = loop_delay(solution, velocities)
        if found is None or (delay is not None and abs(found.seconds) < SETTLED):
            break
        # The graph gives way to a share of each correction: what is left of the last one says how large that is, as
        # long as the same loops say it.
        left = found.seconds / last if same else 0.0
        step = found.seconds * (min(1.0 / (1.0 - left), FASTER) if 0.0 < left < 1.0 else 1.0)
        total = replace(found, seconds=step if delay is None else delay.seconds + step)
        if not total.is_certain:
            break
        corrected = graph.with_loops(at_color(loop, total.seconds, velocities) for loop in graph.loops).optimize()
        if len(corrected.loops) < needed:
            break
        solution, delay, last, same = corrected, total, step, corrected.loops == solution.loops
    return TimedSolution(solution, delay)


def loop_delay(solution: GraphSolution, velocities: Mapping[int, FloatArray]) -> LoopDelay | None:
    """The delay that accepted loops show against the graph's poses; None of too few loops."""
    turned, off = [], []
    for verdict in solution.verdicts:
        loop = verdict.constraint
        if verdict.accepted and loop.method == BY_DEPTH and {loop.match, loop.query} <= velocities.keys():
            T_query_match = invert(solution.poses[loop.query]) @ solution.poses[loop.match]
            whiten = np.linalg.inv(np.linalg.cholesky(loop.covariance))
            turned.append(whiten @ (velocities[loop.query] - adjoint(T_query_match) @ velocities[loop.match]))
            off.append(whiten @ tangent(T_query_match @ loop.T_match_query))
    if len(off) < FEWEST:
        return None
    a, b = np.concatenate(turned), np.concatenate(off)
    weights, delay = np.ones(len(a)), 0.0
    for _ in range(STEPS):
        delay = float((weights * a * b).sum() / max((weights * a * a).sum(), 1e-12))
        rest = np.abs(b - delay * a)
        weights = np.minimum(1.0, HUBER_K * 1.48 * np.median(rest) / np.maximum(rest, 1e-12))
    information = max(float((weights * a * a).sum()), 1e-12)
    # The graph has taken a part of the loops' errors, so their spread is that of all its residuals over its redundancy.
    scale = 2.0 * solution.cost / (6 * len(solution.loops)) * solution.loop_scale**2
    return LoopDelay(delay, float(np.sqrt(scale / information)), len(off))


def at_color(loop: LoopConstraint, seconds: float, velocities: Mapping[int, FloatArray]) -> LoopConstraint:
    """A loop that depth measured, at the instants of its colour images; others as they are."""
    if loop.method != BY_DEPTH or not {loop.match, loop.query} <= velocities.keys():
        return loop
    T_match_later, T_query_later = (_moved(velocities[key], seconds) for key in (loop.match, loop.query))
    return replace(loop, T_match_query=T_match_later @ loop.T_match_query @ invert(T_query_later))


def _moved(velocity: FloatArray, seconds: float) -> Transform:
    """The pose (4, 4) to which a camera moves in a time."""
    return make_transform(exp_so3(velocity[:3] * seconds), velocity[3:] * seconds)
