"""How much drift loops take away: every odometry without and with detectors, over several starts.

    python benchmarks/drift.py run SEQUENCE... --folder DIR --jobs 2 --starts 0,2,4,6,8
    python benchmarks/drift.py table DIR
    python benchmarks/drift.py list DIR

Each odometry tracks a sequence once per start (those of ``--once`` at the first start alone); its recording is kept in
DIR and replayed with each detector. Every replay adds a line to DIR/rows.csv, and what stands there is not done again:
a run that was stopped goes on where it was. After a change of verification or back end delete rows.csv, after one of an
odometry its recordings. With ``--runs`` each replay also leaves a run folder.

A process takes one start, on one thread; odometries and detectors share its segmentations and verified pairs of frames.

The table gives the median and the range over the starts of the ATE (SE(3), all frames) in centimetres, each detector's
change against no loops, and which part it removes of what lies above the best front end of the sequence. The list has
a line for each detector: live, pose graph and final trajectory, and the change from live to final at the worst start.
"""

import argparse
import csv
import os
import re
import statistics
import time
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

import numpy as np

from semslam.config import Config
from semslam.datasets import Dataset, open_dataset
from semslam.datasets.selection import Selection
from semslam.loop.verification.icp import IcpVerifier
from semslam.runs.metrics import Metrics
from semslam.runs.pipeline import replay, run
from semslam.runs.recording import read_recording, write_recording
from semslam.runs.results import write_run
from semslam.types import Frame, Keyframe, LoopCandidate, LoopConstraint, LoopRejection

ROWS = "rows.csv"
ALONE = "none"
KEY = ("sequence", "odometry", "start", "detector")
VALUES = ("alone_m", "live_m", "graph_m", "ate_m", "tracked", "accepted", "true", "inaccurate", "false")
Row = dict[str, str]
NameT = TypeVar("NameT", bound=Hashable)


class Rendered:
    """A dataset whose frames are made once, kept in a folder: rendering takes longer than tracking."""

    def __init__(self, dataset: Dataset, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._dataset, self._folder = dataset, folder
        self.name, self.intrinsics, self.notes = dataset.name, dataset.intrinsics, dataset.notes
        self.timestamps, self.ground_truth = dataset.timestamps, dataset.ground_truth

    def __len__(self) -> int:
        return len(self._dataset)

    def frame(self, index: int) -> Frame:
        """A frame, rendered when it is first asked for."""
        path = self._folder / f"{index}.npz"
        if not path.exists():
            frame = self._dataset.frame(index)
            partial_path = path.with_suffix(f".{os.getpid()}.npz")
            np.savez(partial_path, color=frame.color, depth=frame.depth)
            partial_path.rename(path)
            return frame
        with np.load(path) as kept:
            return Frame(index, self.timestamps[index], kept["color"], kept["depth"], self.intrinsics)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))


class Remembered:
    """A verifier that looks at each pair of frames once; with other nodes, guess or prediction it is another pair."""

    def __init__(self, config: Config) -> None:
        self._verifier = IcpVerifier.from_config(config)
        self._known: dict[Hashable, LoopConstraint | LoopRejection] = {}

    def verify(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> LoopConstraint | LoopRejection:
        """The verifier's outcome, stored from before for the same two frames."""
        prediction = None if candidate.prediction is None else candidate.prediction.tobytes()
        key = (query.frame_index, match.frame_index, candidate.evidence.nodes, candidate.guess, prediction)
        if key not in self._known:
            self._known[key] = self._verifier.verify(query, match, candidate)
        return replace(self._known[key], candidate=candidate)


def measure(arguments: argparse.Namespace) -> None:
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    arguments.folder.mkdir(parents=True, exist_ok=True)
    starts = [int(start) for start in arguments.starts.split(",")]
    tasks = [(sequence, start, start == starts[0]) for sequence in arguments.sequences for start in starts]
    with get_context("spawn").Pool(arguments.jobs, maxtasksperchild=1) as pool:
        for rows in pool.imap_unordered(partial(measure_start, arguments), tasks, chunksize=1):
            print(f"{rows} rows added", flush=True)


def measure_start(arguments: argparse.Namespace, task: tuple[str, int, bool]) -> int:
    """All odometries and detectors on one start of a sequence; returns how many rows that took."""
    sequence, start, once = task
    done = {key_of(row) for row in read_rows(arguments.folder / ROWS)}
    dataset, added = open_dataset(sequence), 0
    name = label_of(sequence)
    if sequence.startswith("synthetic"):
        dataset = Rendered(dataset, arguments.folder / "frames" / file_name(name))
    if start or arguments.max_frames:
        dataset = Selection(dataset, start, arguments.max_frames)
    odometries = [*listed(arguments.odometries), *(listed(arguments.once) if once else [])]
    for odometry in odometries:
        config = config_of(arguments, odometry, start)
        verifier = Remembered(Config())  # one each: an odometry's velocities take the rolling shutter out of keyframes
        kept = arguments.folder / f"{file_name(name)}-{odometry}-{start}"
        for detector in listed(arguments.detectors):
            if (name, odometry, str(start), detector) in done:
                continue
            record(dataset, config, kept)
            spent = time.process_time()
            changed = config.with_changes(detector=detector)
            result = replay(dataset, read_recording(kept), changed, verifier=verifier)
            if arguments.runs:
                write_run(result, dataset, kept.with_name(f"{kept.name}-{detector}"), plots=False)
            add_row(arguments.folder / ROWS, row_of(result.metrics, name, start), time.process_time() - spent)
            added += 1
    return added


def config_of(arguments: argparse.Namespace, odometry: str, start: int) -> Config:
    config = Config(odometry=odometry, detector=ALONE).with_changes(
        dataset={"start": start, "max_frames": arguments.max_frames},
        segmentation={"cache_dir": arguments.folder / "labels"},
    )
    # What each loop brought is for the ledger, and solves the graph once for each of them.
    return config if arguments.runs else config.with_changes(backend={"contribution_limit": 0})


def record(dataset: Dataset, config: Config, directory: Path) -> None:
    """Track a sequence, unless that was done before."""
    if directory.exists():
        return
    spent, unfinished = time.process_time(), directory.with_suffix(".partial")
    recording = run(dataset, config).recording
    unfinished.mkdir(exist_ok=True)
    write_recording(unfinished, recording)
    unfinished.rename(directory)
    print(f"recorded {directory.name}, {time.process_time() - spent:.0f} s", flush=True)


def label_of(sequence: str) -> str:
    """A folder by its name, a rendered scene by all that was asked of it."""
    return sequence if sequence.startswith("synthetic") else Path(sequence).name


def file_name(label: str) -> str:
    """The label with every character that a file's name should not have replaced."""
    return re.sub(r"[^A-Za-z0-9_.-]", "-", label)


def row_of(metrics: Metrics, name: str, start: int) -> Row:
    values: dict[str, object] = {
        "sequence": name,
        "odometry": metrics.odometry,
        "start": start,
        "detector": metrics.detector,
        "alone_m": metrics.odometry_only.ate_rmse_m,
        "live_m": metrics.live.ate_rmse_m,
        "graph_m": metrics.pose_graph.ate_rmse_m,
        "ate_m": metrics.optimized.ate_rmse_m,
        "tracked": round(metrics.tracked / metrics.frames, 4),
        "accepted": metrics.loops.accepted,
        "true": metrics.loops.true,
        "inaccurate": metrics.loops.inaccurate,
        "false": metrics.loops.false,
    }
    return {name: str(value) for name, value in values.items()}


def key_of(row: Row) -> tuple[str, ...]:
    return tuple(row[name] for name in KEY)


def read_rows(path: Path) -> list[Row]:
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return sorted(rows, key=lambda row: (row["sequence"], row["odometry"], int(row["start"])))


def add_row(path: Path, row: Row, spent: float) -> None:
    fresh = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*KEY, *VALUES])
        if fresh:
            writer.writeheader()
        writer.writerow(row)
    print(f"{', '.join(row.values())}, {spent:.0f} s", flush=True)


def print_table(arguments: argparse.Namespace) -> None:
    rows = read_rows(arguments.folder / ROWS)
    detectors = [name for name in unique(row["detector"] for row in rows) if name != ALONE]
    head = ["sequence", "odometry", "starts", "odometry alone", "no loops"]
    for name in detectors:
        head += [name, "change", "of the excess removed", "true/inaccurate/false"]
    print(f"| {' | '.join([*head, 'tracked'])} |\n|{'---|' * (len(head) + 1)}")
    for sequence in unique(row["sequence"] for row in rows):
        inside = [row for row in rows if row["sequence"] == sequence]
        odometries = unique(row["odometry"] for row in inside)
        best = min(statistics.median(errors(inside, odometry, ALONE).values()) for odometry in odometries)
        for odometry in odometries:
            print(line(inside, sequence, odometry, detectors, best), flush=True)


def print_list(arguments: argparse.Namespace) -> None:
    rows = read_rows(arguments.folder / ROWS)
    head = "sequence | odometry | detector | live, cm | pose graph, cm | ATE, cm | to live, worst | true/inacc./false"
    print(f"| {head} |\n|{'---|' * 8}")
    for sequence, odometry, detector in unique((row["sequence"], row["odometry"], row["detector"]) for row in rows):
        inside = [row for row in rows if row["sequence"] == sequence]
        kinds = [sum(errors(inside, odometry, detector, kind).values()) for kind in ("true", "inaccurate", "false")]
        live, graph, final = (errors(inside, odometry, detector, of) for of in ("live_m", "graph_m", "ate_m"))
        worst = max((final[start] / live[start] - 1 for start in final if start in live), default=float("nan"))
        cells = [sequence, odometry, detector, *(spread(each.values()) for each in (live, graph, final))]
        print(f"| {' | '.join(cells)} | {100 * worst:+.0f} % | {'/'.join(f'{kind:.0f}' for kind in kinds)} |")


def line(rows: Sequence[Row], sequence: str, odometry: str, detectors: Sequence[str], best: float) -> str:
    alone = errors(rows, odometry, ALONE)
    causal = errors(rows, odometry, ALONE, "alone_m")
    cells = [sequence, odometry, str(len(alone)), spread(causal.values()), spread(alone.values())]
    for name in detectors:
        closed = errors(rows, odometry, name)
        pairs = [(alone[start], closed[start]) for start in closed if start in alone]
        changes = [100 * (after / before - 1) for before, after in pairs]
        excess = [(before - after) / (before - best) for before, after in pairs if before > 1.1 * best]
        kinds = [sum(errors(rows, odometry, name, kind).values()) for kind in ("true", "inaccurate", "false")]
        cells += [
            spread(closed.values()),
            f"{statistics.median(changes):+.0f} % (worst {max(changes):+.0f})" if changes else "-",
            f"{100 * statistics.median(excess):.0f} %" if excess else "-",
            "/".join(f"{kind:.0f}" for kind in kinds),
        ]
    tracked = [float(row["tracked"]) for row in rows if row["odometry"] == odometry]
    return f"| {' | '.join([*cells, f'{100 * min(tracked):.0f} %'])} |"


def listed(names: str) -> list[str]:
    return [name for name in names.split(",") if name]


def errors(rows: Iterable[Row], odometry: str, detector: str, column: str = "ate_m") -> dict[str, float]:
    """A value by start."""
    chosen = [row for row in rows if (row["odometry"], row["detector"]) == (odometry, detector)]
    return {row["start"]: float(row[column]) for row in chosen if row[column] != "None"}


def unique(names: Iterable[NameT]) -> list[NameT]:
    return list(dict.fromkeys(names))


def spread(metres: Iterable[float]) -> str:
    known = [100 * value for value in metres]
    if not known:
        return "-"
    if len(known) == 1:
        return f"{known[0]:.2f}"
    return f"{statistics.median(known):.2f} ({min(known):.2f} to {max(known):.2f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    measuring = commands.add_parser("run")
    measuring.set_defaults(work=measure)
    measuring.add_argument("sequences", nargs="+")
    measuring.add_argument("--folder", type=Path, required=True)
    measuring.add_argument("--odometries", default="feature,dense,kiss,feature_map")
    measuring.add_argument("--once", default="dense_keyframe", help="odometries for the first start alone")
    measuring.add_argument("--detectors", default="none,semantic,fused")
    measuring.add_argument("--starts", default="0,2,4,6,8")
    measuring.add_argument("--max-frames", type=int)
    measuring.add_argument("--jobs", type=int, default=1, help="processes, of one thread each")
    measuring.add_argument("--runs", action="store_true", help="leave a run folder of each replay")
    for name, work in (("table", print_table), ("list", print_list)):
        printing = commands.add_parser(name)
        printing.set_defaults(work=work)
        printing.add_argument("folder", type=Path)
    (arguments := parser.parse_args()).work(arguments)


if __name__ == "__main__":
    main()
