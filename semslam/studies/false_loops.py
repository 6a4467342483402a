"""Injects false loops into a saved run's graph and scores it against ground truth."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pydantic import BaseModel, ConfigDict

from semslam import plugins
from semslam.backend.analysis.stress import Attack, stress
from semslam.backend.graph.g2o import read_g2o
from semslam.backend.graph.products import GraphSolution
from semslam.errors import ResultsError, TrajectoryError
from semslam.eval.trajectory import score_trajectory
from semslam.runs.results import SavedRun, read_run
from semslam.types import Trajectory


class StressRow(BaseModel):
    """One back end: keyframe ATE in metres without and with the false loops, shares of loops kept."""

    model_config = ConfigDict(frozen=True)

    name: str
    ate_clean_m: float | None
    ate_m: float | None
    true_kept: float
    false_kept: float


def stress_run(directory: Path, attacks: Sequence[Attack], strategies: Sequence[str] | None = None) -> list[StressRow]:
    """Inject false loops into a run's graph and optimise it by each strategy.

    Args:
        directory: the run folder.
        attacks: the false loops, one set after the other.
        strategies: names; None = all.

    Returns:
        A row per attack and strategy, those of one attack side by side.

    Raises:
        ConfigError: a strategy is unknown.
        GraphError: the graph has no loop, or is too small.
        ResultsError: it is no run folder, or was written by another version.
    """
    saved = read_run(directory)
    names = plugins.names("semslam.robust") if strategies is None else list(strategies)
    graph = read_g2o(directory / "graph.g2o")
    outcomes = stress(graph, attacks, names, saved.config.backend)
    return [
        StressRow(
            name=outcome.name,
            ate_clean_m=_ate(outcome.clean, saved),
            ate_m=_ate(outcome.stressed, saved),
            true_kept=outcome.true_kept,
            false_kept=outcome.false_kept,
        )
        for outcome in outcomes
    ]


def _ate(solution: GraphSolution, saved: SavedRun) -> float | None:
    """ATE in metres of the keyframes of the solution's largest map."""
    if saved.ground_truth is None:
        return None
    stamps = saved.keyframe_stamps
    keys = sorted(solution.components[0])
    if not stamps.keys() >= set(keys):
        raise ResultsError(f"The graph in {saved.directory} does not go with its keyframes.")
    poses = np.stack([solution.poses[key] for key in keys])
    try:
        estimate = Trajectory(np.array([stamps[key] for key in keys]), poses)
        return score_trajectory(estimate, saved.ground_truth).ate_rmse_m
    except TrajectoryError:
        return None
