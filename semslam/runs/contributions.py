"""What each accepted loop contributes: the graph and its error without that loop."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from semslam.backend.analysis.contribution import leave_one_out
from semslam.backend.graph.products import GraphSolution
from semslam.config import BackendConfig
from semslam.errors import TrajectoryError
from semslam.eval.trajectory import Pairs, associate, rmse_after_alignment
from semslam.types import Keyframe, LoopContribution, Trajectory, Transform


def loop_contributions(
    solution: GraphSolution, keyframes: Sequence[Keyframe], truth: Trajectory | None, config: BackendConfig
) -> list[LoopContribution | None]:
    """Solve the graph without each accepted loop in turn.

    Args:
        solution: the optimised graph.
        keyframes: of all maps.
        truth: ground truth, or None.
        config: limits; a graph over ``contribution_limit`` is left alone, for it is solved once for each loop.

    Returns:
        What each loop brought, in the order of the verdicts; None for loops that were not accepted.
    """
    accepted = sum(verdict.accepted for verdict in solution.verdicts)
    if accepted * len(keyframes) > config.contribution_limit:
        return [None] * len(solution.verdicts)
    error = _KeyframeError(solution, keyframes, truth)
    found = (
        LoopContribution(one.tension, one.shift_m, error.difference(one.poses, one.poses_with))
        for one in leave_one_out(solution, config)
    )
    return [next(found) if verdict.accepted else None for verdict in solution.verdicts]


class _KeyframeError:
    """ATE of the largest component's keyframes; unknown where ground truth meets fewer than three of them."""

    def __init__(self, solution: GraphSolution, keyframes: Sequence[Keyframe], truth: Trajectory | None) -> None:
        self._pairs: Pairs | None = None
        largest = set(solution.components[0])
        inside = [keyframe for keyframe in keyframes if keyframe.id in largest]
        stamps = np.array([keyframe.timestamp for keyframe in inside])
        estimate = Trajectory(stamps, np.stack([solution.poses[keyframe.id] for keyframe in inside]))
        if truth is None:
            return
        try:
            self._pairs = associate(estimate, truth)
        except TrajectoryError:
            return
        key_at = {keyframe.timestamp: keyframe.id for keyframe in inside}
        self._keys = [key_at[stamp] for stamp in self._pairs.timestamps.tolist()]

    def difference(self, poses: Mapping[int, Transform], reference: Mapping[int, Transform]) -> float | None:
        """The ATE of ``poses`` minus that of ``reference``, metres."""
        if self._pairs is None:
            return None
        return self._ate(self._pairs, poses) - self._ate(self._pairs, reference)

    def _ate(self, pairs: Pairs, poses: Mapping[int, Transform]) -> float:
        return rmse_after_alignment(replace(pairs, estimated=np.stack([poses[key] for key in self._keys])))
