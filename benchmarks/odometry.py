"""Odometries beside one another, and ORB-SLAM3 beside them: error of the live trajectory, time and lost frames.

    python benchmarks/odometry.py SEQUENCE... [--odometry NAME...] [--starts 0 2 4 6 8] [--optimize]
        [--peer PYTHON RUN.PY --depth-scale 5000]
    python benchmarks/odometry.py SEQUENCE... --faults [NUMBER...] [--detector NAME]

``--optimize`` adds the error after the final bundle adjustment. ``--peer`` names a Python with the pyorbslam3 wheel
and a script that runs it over a TUM-layout folder and writes a trajectory; it is run three times for each start, since
it is not deterministic, and its median is quoted. Times are CPU seconds of the tracking thread, without decoding.
``--faults`` runs each sequence whole, once for each fault put into it 10 s after its start, or for those of the numbers
given (0 = none); the last one leaves frames out behind a black-out, so that the camera wakes up elsewhere.
"""

import argparse
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semslam import plugins
from semslam.backend.pose_graph import PoseGraph
from semslam.config import Config, DatasetConfig, FaultConfig
from semslam.datasets import Dataset, open_dataset
from semslam.datasets.tum_format import read_trajectory
from semslam.eval.trajectory import score_trajectory
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.frontend.odometry import Odometry
from semslam.runs.pipeline import run
from semslam.runtime.stopwatch import Stopwatch
from semslam.system.slam import Slam
from semslam.types import Frame, Motion, TrackingStatus, Trajectory

PEER_RUNS = 3
FRAME = 1 / 30
FAULTS = {
    "none": FaultConfig(),
    "10 % of the frames dropped": FaultConfig(drop=0.1),
    "1 s of black frames": FaultConfig(black=((10.0, 11.0),)),
    "1 s without depth": FaultConfig(no_depth=((10.0, 11.0),)),
    "2 s gap": FaultConfig(gaps=((10.0, 12.0),)),
    "frames 0-199, 60 black, from 400 on": FaultConfig(
        black=((199.5 * FRAME, 259.5 * FRAME),), gaps=((259.5 * FRAME, 399.5 * FRAME),)
    ),
}


@dataclass(frozen=True, slots=True)
class Row:
    """One run: ATE in metres (live, and optimised where asked), milliseconds a frame, frames lost."""

    live: float
    optimized: float | None
    median_ms: float
    p95_ms: float
    lost: int


class TimedOdometry:
    """An odometry whose every frame is timed."""

    def __init__(self, odometry: Odometry) -> None:
        self._odometry = odometry
        self.milliseconds: list[float] = []

    def track(self, frame: Frame) -> Motion:
        """As the odometry's own."""
        began = time.thread_time()
        motion = self._odometry.track(frame)
        self.milliseconds.append(1000 * (time.thread_time() - began))
        return motion


def track(name: str, path: Path, start: int, optimize: bool) -> Row:
    dataset = open_dataset(path, DatasetConfig(start=start))
    config = Config().with_changes(odometry=name, detector="none")
    odometry = TimedOdometry(plugins.load("semslam.odometry", name).from_config(config))
    builder = KeyframeBuilder(config, details=False)
    slam = Slam(odometry, builder, None, PoseGraph(config.backend), config, Stopwatch())
    states = [slam.process(frame) for frame in dataset]
    timestamps = np.array(dataset.timestamps)
    return Row(
        live=ate(dataset, timestamps, np.array([state.T_odom_cam for state in states])),
        optimized=ate(dataset, timestamps, slam.finish().poses) if optimize else None,
        median_ms=float(np.median(odometry.milliseconds)),
        p95_ms=float(np.percentile(odometry.milliseconds, 95)),
        lost=sum(state.status is TrackingStatus.LOST for state in states),
    )


def ate(dataset: Dataset, timestamps: np.ndarray, poses: np.ndarray) -> float:
    if dataset.ground_truth is None:
        raise SystemExit(f"{dataset.name} has no ground truth.")
    return score_trajectory(Trajectory(timestamps, poses), dataset.ground_truth).ate_rmse_m


def run_peer(peer: Sequence[str], path: Path, start: int, depth_scale: float) -> list[float]:
    """ATE of each run of the peer."""
    dataset = open_dataset(path, DatasetConfig(start=start))
    camera = dataset.intrinsics
    numbers = [camera.fx, camera.fy, camera.cx, camera.cy, *(camera.distortion if camera.is_distorted else ())]
    errors = []
    for _ in range(PEER_RUNS):
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "trajectory.txt"
            command = [*peer, str(path), str(out), "--start", str(start), "--depth-scale", str(depth_scale)]
            subprocess.run([*command, "--camera", *map(str, numbers)], check=True, capture_output=True)
            trajectory, _ = read_trajectory(out)
        errors.append(ate(dataset, trajectory.timestamps, trajectory.poses))
    return errors


def print_faults(path: Path, name: str, detector: str, numbers: Sequence[int]) -> None:
    """Figures are of the largest map, as everywhere."""
    print(
        "| sequence | odometry | detector | fault | frames | tracked | maps | lost, s | live ATE (m) | final ATE (m) |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for label, faults in [list(FAULTS.items())[number] for number in numbers or range(len(FAULTS))]:
        settings = DatasetConfig(faults=faults)
        config = Config().with_changes(odometry=name, detector=detector).model_copy(update={"dataset": settings})
        found = run(open_dataset(path, settings), config).metrics
        spells = ", ".join(f"{begin:.2f}-{end:.2f}" for begin, end in found.lost_intervals) or "-"
        print(
            f"| {path.name} | {name} | {detector} | {label} | {found.frames} | {found.tracked} | {found.maps} "
            f"| {spells} | {found.odometry_only.ate_rmse_m:.4f} | {found.optimized.ate_rmse_m:.4f} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", type=Path, nargs="+")
    parser.add_argument("--odometry", nargs="+", default=["feature_map"])
    parser.add_argument("--starts", type=int, nargs="+", default=[0])
    parser.add_argument("--optimize", action="store_true")
    parser.add_argument("--peer", nargs=2, metavar=("PYTHON", "SCRIPT"))
    parser.add_argument("--depth-scale", type=float, default=5000.0, help="of the sequences, for the peer")
    parser.add_argument("--faults", type=int, nargs="*", choices=range(len(FAULTS)), metavar="NUMBER")
    parser.add_argument("--detector", default="none", help="with --faults")
    args = parser.parse_args()
    if args.faults is not None:
        for path in args.sequences:
            for name in args.odometry:
                print_faults(path, name, args.detector, args.faults)
        return
    print("| sequence | odometry | start | live ATE (m) | optimised ATE (m) | median ms | p95 ms | lost |")
    print("|---|---|---|---|---|---|---|---|")
    for path in args.sequences:
        for start in args.starts:
            for name in args.odometry:
                row = track(name, path, start, args.optimize)
                optimized = "-" if row.optimized is None else f"{row.optimized:.4f}"
                print(
                    f"| {path.name} | {name} | {start} | {row.live:.4f} | {optimized} "
                    f"| {row.median_ms:.1f} | {row.p95_ms:.1f} | {row.lost} |",
                    flush=True,
                )
            if args.peer:
                errors = run_peer(args.peer, path, start, args.depth_scale)
                spread = f"{np.median(errors):.4f} ({min(errors):.4f} to {max(errors):.4f})"
                print(f"| {path.name} | ORB-SLAM3 | {start} | - | {spread} | - | - | - |", flush=True)


if __name__ == "__main__":
    main()
