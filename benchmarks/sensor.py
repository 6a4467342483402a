"""Sensors estimated from recordings: against the truth of rendered ones, and what the estimate is worth in a run.

    python benchmarks/sensor.py [--scene room] [--frames 60] [--readouts 0 0.01 0.026 0.033] [--delays -0.02 0 0.02]
        [--depth-readout 0.03] [--seeds 0] [--track feature_map ...]
    python benchmarks/sensor.py --sequence DIR... [--frames 300]
    python benchmarks/sensor.py --freiburg1 FOLDER

Rendered scenes state nothing of their timing here. ``--track`` adds the live ATE of odometries over the same
frames with the true times, with those that a run would estimate, and with none. ``--sequence`` estimates the
sensor of recordings. ``--freiburg1`` runs the nine sequences of TUM's fr1 that lie in a folder, whole and with default
settings, and prints their final ATE.
"""

import argparse
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import islice, product
from pathlib import Path

import numpy as np

from semslam import plugins
from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.datasets.camera_file import CameraSetup
from semslam.eval.trajectory import score_trajectory
from semslam.frontend.sensor.calibration import calibrate
from semslam.frontend.sensor.estimate import Estimate
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import compose
from semslam.runs.pipeline import run
from semslam.types import Frame, Trajectory

FREIBURG1 = ("360", "desk", "desk2", "floor", "plant", "room", "rpy", "teddy", "xyz")


def cell(found: Estimate) -> str:
    """Milliseconds with their standard deviation, in brackets where they are known roughly, or a dash."""
    value = f"{1000 * found.value:.1f} ± {1000 * found.sigma:.1f}"
    return value if found.is_determined else f"({value})" if found.is_rough else "-"


def live_ate(name: str, frames: Iterable[Frame], truth: Trajectory, camera: Intrinsics) -> str:
    """ATE of the causal poses in centimetres."""
    odometry = plugins.load("semslam.odometry", name).from_config(Config())
    stamps, motions = [], []
    for frame in frames:
        stamps.append(frame.timestamp)
        motions.append(odometry.track(replace(frame, intrinsics=camera)).T_prev_cur)
    poses = compose(motions[1:], np.eye(4))
    error = score_trajectory(Trajectory(np.array(stamps), poses), truth).ate_rmse_m
    return "-" if error is None else f"{100 * error:.2f}"


def rendered(arguments: argparse.Namespace) -> None:
    """A row for each read-out, delay and seed."""
    columns = ["scene", "seed", "read-out", "delay", "read-out found", "delay found", "depth's read-out found"]
    columns += [f"{name}, {times}" for name in arguments.track for times in ("true", "estimated", "none")]
    print_row(columns)
    print_row(["---"] * len(columns))
    for seed, readout, delay in product(arguments.seeds, arguments.readouts, arguments.delays):
        timing = f"readout={readout}&delay={delay}&depth_readout={arguments.depth_readout}&stated=0"
        dataset = open_dataset(f"synthetic:{arguments.scene}?seed={seed}&{timing}")
        frames = list(islice(dataset, arguments.frames))
        estimate = calibrate(frames)
        found = [cell(estimate.readout), cell(estimate.delay), cell(estimate.depth_readout)]
        errors = []
        if dataset.ground_truth is not None:
            unknown = dataset.intrinsics
            true = replace(unknown, readout=readout, delay=delay, depth_readout=arguments.depth_readout)
            estimated = estimate.applied(CameraSetup(unknown)).intrinsics
            errors = [
                live_ate(name, frames, dataset.ground_truth, camera)
                for name in arguments.track
                for camera in (true, estimated, unknown)
            ]
        print_row([arguments.scene, str(seed), f"{1000 * readout:.0f}", f"{1000 * delay:.0f}", *found, *errors])


def recorded(paths: Sequence[Path], count: int) -> None:
    """A row for each recording."""
    print_row(["sequence", "stated", "read-out found", "delay found", "depth's read-out found"])
    print_row(["---"] * 5)
    for path in paths:
        dataset = open_dataset(path)
        estimate = calibrate(islice(dataset, count))
        stated = dataset.intrinsics.readout
        shown = "-" if stated is None else f"{1000 * stated:.1f}"
        print_row([path.name, shown, cell(estimate.readout), cell(estimate.delay), cell(estimate.depth_readout)])


def freiburg1(folder: Path) -> None:
    """The final ATE of each of the nine sequences that is there."""
    print_row(["sequence", "semslam, cm"])
    print_row(["---", "---"])
    for name in FREIBURG1:
        path = folder / f"rgbd_dataset_freiburg1_{name}"
        if not path.is_dir():
            print_row([f"fr1/{name}", ""])
            continue
        error = run(open_dataset(path)).metrics.optimized.ate_rmse_m
        print_row([f"fr1/{name}", "-" if error is None else f"{100 * error:.2f}"])


def print_row(cells: Sequence[str]) -> None:
    """A row of a Markdown table."""
    print(f"| {' | '.join(cells)} |")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="room")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--readouts", type=float, nargs="+", default=[0.0, 0.01, 0.026, 0.033])
    parser.add_argument("--delays", type=float, nargs="+", default=[-0.02, 0.0, 0.02])
    parser.add_argument("--depth-readout", type=float, default=0.03)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--track", nargs="+", default=[], metavar="ODOMETRY")
    parser.add_argument("--sequence", type=Path, nargs="+")
    parser.add_argument("--freiburg1", type=Path)
    arguments = parser.parse_args()
    if arguments.freiburg1:
        freiburg1(arguments.freiburg1)
    elif arguments.sequence:
        recorded(arguments.sequence, arguments.frames)
    else:
        rendered(arguments)


if __name__ == "__main__":
    main()
