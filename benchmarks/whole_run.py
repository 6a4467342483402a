"""What a whole run costs beside ORB-SLAM3: wall and processor time, memory, and the errors that come of it.

    python benchmarks/whole_run.py SEQUENCE... [--workers none,thread,process] [--repeats 3]
        [--peer PYTHON RUN.PY --depth-scale 5000]

Each sequence is run ``--repeats`` times by each worker (where loops are closed) and by the peer, in turns, so that a
busy machine is busy for all of them; medians are printed as a Markdown table. Processor time includes the worker's
process. The peer's command is called as in ``benchmarks/odometry.py``.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.datasets.tum_format import read_trajectory
from semslam.eval.trajectory import score_trajectory


@dataclass(frozen=True, slots=True)
class Cost:
    """One run: seconds, megabytes of the largest process, ATE in metres (final, live), accepted and false loops."""

    wall_s: float
    cpu_s: float
    peak_mb: float
    ate_m: float | None
    live_m: float | None = None
    loops: str = "-"


def timed(command: Sequence[str]) -> tuple[float, float, float]:
    """Wall and processor seconds of a command with the children it has waited for, and its peak memory in megabytes."""
    began = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    assert process.stderr is not None
    complaint = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status):
        raise SystemExit(complaint.decode())
    return time.perf_counter() - began, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def run_ours(path: Path, worker: str, detector: str) -> Cost:
    """A run of semslam without plots."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        command = [sys.executable, "-m", "semslam", "run", str(path), "--detector", detector, "--no-plots"]
        spent = timed([*command, "--out", str(out), "--set", f"loops.worker={worker}"])
        metrics = json.loads((out / "metrics.json").read_text())
    loops = metrics["loops"]
    return Cost(
        *spent,
        metrics["optimized"]["ate_rmse_m"],
        metrics["live"]["ate_rmse_m"],
        f"{loops['accepted']} / {loops['false']}",
    )


def run_peer(peer: Sequence[str], path: Path, depth_scale: float) -> Cost:
    """A run of the peer over the same images."""
    dataset = open_dataset(path)
    camera = dataset.intrinsics
    numbers = [camera.fx, camera.fy, camera.cx, camera.cy, *(camera.distortion if camera.is_distorted else ())]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "trajectory.txt"
        command = [*peer, str(path), str(out), "--start", "0", "--depth-scale", str(depth_scale)]
        spent = timed([*command, "--camera", *map(str, numbers)])
        trajectory, _ = read_trajectory(out)
    truth = dataset.ground_truth
    return Cost(*spent, None if truth is None else score_trajectory(trajectory, truth).ate_rmse_m)


def row(path: Path, name: str, costs: Sequence[Cost]) -> str:
    """Medians of the repeats as a row of the table."""

    def median(values: Sequence[float | None]) -> float | None:
        known = [value for value in values if value is not None]
        return statistics.median(known) if known else None

    def metres(value: float | None) -> str:
        return "-" if value is None else f"{100 * value:.2f}"

    wall, cpu = [c.wall_s for c in costs], [c.cpu_s for c in costs]
    cells = (
        path.name,
        name,
        f"{median(wall):.1f} ({min(wall):.1f} to {max(wall):.1f})",
        f"{median(cpu):.1f} ({min(cpu):.1f} to {max(cpu):.1f})",
        f"{median([c.peak_mb for c in costs]):.0f}",
        metres(median([c.ate_m for c in costs])),
        metres(median([c.live_m for c in costs])),
        costs[-1].loops,
    )
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Run everything in turns and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--peer", nargs=2, metavar=("PYTHON", "SCRIPT"))
    parser.add_argument("--depth-scale", type=float, default=5000.0, help="of the sequences, for the peer")
    parser.add_argument("--workers", default="none,thread,process")
    parser.add_argument("--detector", default=Config().detector)
    parser.add_argument("--repeats", type=int, default=3)
    args = parser.parse_args()
    print("| sequence | run | wall s | CPU s | peak MB | ATE cm | live ATE cm | loops accepted / false |")
    print("|---|---|---|---|---|---|---|---|")
    for path in args.sequences:
        costs: dict[str, list[Cost]] = {}
        for _ in range(args.repeats):
            for worker in args.workers.split(","):
                costs.setdefault(f"semslam, {worker}", []).append(run_ours(path, worker, args.detector))
            if args.peer:
                costs.setdefault("peer", []).append(run_peer(args.peer, path, args.depth_scale))
        for name, found in costs.items():
            print(row(path, name, found), flush=True)


if __name__ == "__main__":
    main()
