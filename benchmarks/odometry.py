"""Odometries beside one another, and ORB-SLAM3 beside them: error of the live trajectory, time and lost frames.

    python benchmarks/odometry.py SEQUENCE... [--odometry NAME...] [--starts 0 2 4 6 8] [--optimize]
        [--peer PYTHON RUN.PY --depth-scale 5000]

``--optimize`` adds the error after the final bundle adjustment. ``--peer`` names a Python with the pyorbslam3 wheel
and a script that runs it over a TUM-layout folder and writes a trajectory; it is run three times for each start, since
it is not deterministic, and its median is quoted. Times are CPU seconds of the tracking thread, without decoding.
"""

import argparse
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eval.trajectory import score_trajectory
from semslam import plugins
from semslam.config import Config, DatasetConfig
from semslam.datasets import Dataset, open_dataset
from semslam.datasets.tum_format import read_trajectory
from semslam.geometry import compose
from semslam.slam import Slam
from semslam.types import TrackingStatus, Trajectory

PEER_RUNS = 3


@dataclass(frozen=True, slots=True)
class Row:
    """One run: ATE in metres (live, and optimised where asked), milliseconds a frame, frames lost."""

    live: float
    optimized: float | None
    median_ms: float
    p95_ms: float
    lost: int


def track(name: str, path: Path, start: int, optimize: bool) -> Row:
    dataset = open_dataset(path, DatasetConfig(start=start))
    config = Config().with_changes(odometry=name, detector="none")
    odometry = plugins.load("semslam.odometry", name).from_config(config)
    motions, milliseconds = [], []
    for frame in dataset:
        began = time.thread_time()
        motions.append(odometry.track(frame))
        milliseconds.append(1000 * (time.thread_time() - began))
    poses = compose([motion.T_prev_cur for motion in motions[1:]], np.eye(4))
    return Row(
        live=ate(dataset, np.array(dataset.timestamps), poses),
        optimized=optimized_ate(dataset, config) if optimize else None,
        median_ms=float(np.median(milliseconds)),
        p95_ms=float(np.percentile(milliseconds, 95)),
        lost=sum(motion.status is TrackingStatus.LOST for motion in motions),
    )


def optimized_ate(dataset: Dataset, config: Config) -> float:
    slam = Slam.from_config(config)
    for frame in dataset:
        slam.process(frame)
    return ate(dataset, np.array(dataset.timestamps), slam.finish().poses)


def ate(dataset: Dataset, timestamps: np.ndarray, poses: np.ndarray) -> float:
    if dataset.ground_truth is None:
        raise SystemExit(f"{dataset.name} has no ground truth.")
    return score_trajectory(Trajectory(timestamps, poses), dataset.ground_truth).ate_rmse_m


def run_peer(peer: Sequence[str], path: Path, start: int, depth_scale: float) -> list[float]:
    """ATE of each run of the peer."""
    dataset = open_dataset(path, DatasetConfig(start=start))
    camera = dataset.intrinsics
    figures = [camera.fx, camera.fy, camera.cx, camera.cy, *(camera.distortion if camera.is_distorted else ())]
    errors = []
    for _ in range(PEER_RUNS):
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "trajectory.txt"
            command = [*peer, str(path), str(out), "--start", str(start), "--depth-scale", str(depth_scale)]
            subprocess.run([*command, "--camera", *map(str, figures)], check=True, capture_output=True)
            trajectory, _ = read_trajectory(out)
        errors.append(ate(dataset, trajectory.timestamps, trajectory.poses))
    return errors


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", type=Path, nargs="+")
    parser.add_argument("--odometry", nargs="+", default=["feature_map"])
    parser.add_argument("--starts", type=int, nargs="+", default=[0])
    parser.add_argument("--optimize", action="store_true")
    parser.add_argument("--peer", nargs=2, metavar=("PYTHON", "SCRIPT"))
    parser.add_argument("--depth-scale", type=float, default=5000.0, help="of the sequences, for the peer")
    args = parser.parse_args()
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
