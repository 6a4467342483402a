"""The trajectories and loops of a run, and the curves that its plots and its page share."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from semslam.errors import TrajectoryError
from semslam.eval.looks import ODOMETRY, OPTIMISED, TRUTH, Stroke
from semslam.eval.trajectory import align, position_errors
from semslam.geometry.se3 import FloatArray
from semslam.types import LedgerEntry, Trajectory

AXES = "xyz"


@dataclass(frozen=True, slots=True, eq=False)
class RunDrawing:
    """The trajectories and loops of a run, for plots.

    Attributes:
        title: stands above each picture.
        odometry: the front end's own trajectory.
        optimised: the final trajectory.
        truth: ground truth, or None.
        loops: candidates, in order of query.
    """

    title: str
    odometry: Trajectory
    optimised: Trajectory
    truth: Trajectory | None
    loops: tuple[LedgerEntry, ...] = ()

    @property
    def start(self) -> float:
        """The stamp at time zero of the plots."""
        return float(min(self.odometry.timestamps[0], self.optimised.timestamps[0]))

    @property
    def end(self) -> float:
        """The last stamp of either trajectory."""
        return float(max(self.odometry.timestamps[-1], self.optimised.timestamps[-1]))


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A trajectory, how it is drawn and its name in a legend."""

    trajectory: Trajectory
    stroke: Stroke
    label: str


@dataclass(frozen=True, slots=True, eq=False)
class ErrorCurve:
    """Values (N,) in metres over stamps (N,) in seconds, with NaN at gaps of the trajectory."""

    stamps: FloatArray
    metres: FloatArray
    stroke: Stroke
    label: str


def aligned(run: RunDrawing) -> RunDrawing:
    """The run with its trajectories aligned with ground truth; without ground truth where the two do not overlap.

    Raises:
        TrajectoryError: a trajectory of the run holds no pose.
    """
    if not len(run.odometry) or not len(run.optimised):
        raise TrajectoryError("There is no pose to draw.")
    if run.truth is None:
        return run
    try:
        odometry, optimised = (align(trajectory, run.truth) for trajectory in (run.odometry, run.optimised))
    except TrajectoryError:
        return replace(run, truth=None)
    during = (run.truth.timestamps >= run.start) & (run.truth.timestamps <= run.end)
    truth = Trajectory(run.truth.timestamps[during], run.truth.poses[during])
    return replace(run, odometry=odometry, optimised=optimised, truth=truth)


def paths(run: RunDrawing) -> list[Path]:
    """The run's trajectories, in drawing order."""
    own = [Path(run.odometry, ODOMETRY, "odometry alone"), Path(run.optimised, OPTIMISED, "optimised")]
    return own if run.truth is None else [Path(run.truth, TRUTH, "ground truth"), *own]


def plane(trajectories: Sequence[Trajectory]) -> tuple[int, int]:
    """The two axes of largest extent, the larger first: the plane of the plots."""
    extent = np.ptp(np.concatenate([trajectory.poses[:, :3, 3] for trajectory in trajectories]), axis=0)
    across, up = np.argsort(-extent, kind="stable")[:2].tolist()
    return across, up


def error_curves(run: RunDrawing) -> list[ErrorCurve]:
    """Position errors of an aligned run before and after optimisation; without ground truth, how far each moved."""
    if run.truth is None:
        stamps, before, after = np.intersect1d(run.odometry.timestamps, run.optimised.timestamps, return_indices=True)
        shift = run.optimised.poses[after, :3, 3] - run.odometry.poses[before, :3, 3]
        moved = broken(stamps, np.asarray(np.linalg.norm(shift, axis=1)))
        return [ErrorCurve(*moved, OPTIMISED, "moved by the optimisation")]
    curves = []
    for path in paths(run)[1:]:
        times, errors = position_errors(path.trajectory, run.truth)
        rmse = float(np.sqrt(np.mean(errors**2)))
        label = f"{path.label}: RMSE {100 * rmse:.1f} cm"
        curves.append(ErrorCurve(*broken(times, errors), path.stroke, label))
    return curves


def loop_ends(run: RunDrawing, loops: Sequence[LedgerEntry]) -> FloatArray:
    """(N, 2, 3) optimised positions of each loop's query and match."""
    times = np.array([(loop.query_time, loop.match_time) for loop in loops]).reshape(-1, 2)
    nearest = np.abs(run.optimised.timestamps[:, None, None] - times).argmin(axis=0)
    return np.asarray(run.optimised.poses[nearest, :3, 3])


def broken(stamps: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Stamps (N,) and values (N, ...) with NaN inserted at gaps, so that no line is drawn across."""
    steps = np.diff(stamps)
    holes = np.flatnonzero(steps > max(0.5, 5 * float(np.median(steps)) if len(steps) else 0.0)) + 1
    return np.insert(stamps, holes, np.nan), np.insert(values, holes, np.nan, axis=0)
