"""How much drift loops take away: every odometry without and with detectors, over several starts.

    python benchmarks/drift.py run SEQUENCE... --folder DIR --odometries feature,dense,kiss --starts 0,2,4,6,8
    python benchmarks/drift.py table DIR
    python benchmarks/drift.py list DIR

Each odometry tracks a sequence once per start; its recording is kept in DIR and replayed with each detector. Every
replay leaves a run folder and adds a line to DIR/rows.csv, and what stands there is not done again: a run that was
stopped goes on where it was. After a change of verification or back end delete rows.csv, after one of an odometry its
recordings.

The table, in Markdown, gives the median and the range over the starts of the ATE (SE(3), all frames) in centimetres,
each detector's change against no loops on the same recording, and which part it removes of what lies above the best
front end of the sequence. The list, for many detectors, has a line for each of them.
"""

import argparse
import csv
import statistics
from collections.abc import Hashable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

from semslam.config import Config, DatasetConfig
from semslam.datasets import Dataset, open_dataset
from semslam.datasets.selection import Selection
from semslam.metrics import Metrics
from semslam.pipeline import replay, run
from semslam.recording import read_recording, write_recording
from semslam.results import write_run
from semslam.types import Frame

ROWS = "rows.csv"
ALONE = "none"
KEY = ("sequence", "odometry", "start", "detector")
FIGURES = ("alone_m", "ate_m", "tracked", "accepted", "true", "inaccurate", "false")
Row = dict[str, str]
NameT = TypeVar("NameT", bound=Hashable)


class Rendered:
    """A dataset whose frames are made once: rendering takes longer than tracking."""

    def __init__(self, dataset: Dataset) -> None:
        self._dataset = dataset
        self._frames: dict[int, Frame] = {}
        self.name, self.intrinsics, self.notes = dataset.name, dataset.intrinsics, dataset.notes
        self.timestamps, self.ground_truth = dataset.timestamps, dataset.ground_truth

    def __len__(self) -> int:
        return len(self._dataset)

    def frame(self, index: int) -> Frame:
        """A frame, rendered when it is first asked for."""
        if index not in self._frames:
            self._frames[index] = self._dataset.frame(index)
        return self._frames[index]

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))


def measure(arguments: argparse.Namespace) -> None:
    arguments.folder.mkdir(parents=True, exist_ok=True)
    rows = arguments.folder / ROWS
    done = {key_of(row) for row in read_rows(rows)}
    for sequence in arguments.sequences:
        whole = open_dataset(sequence)
        whole = Rendered(whole) if sequence.startswith("synthetic") else whole
        for start in map(int, arguments.starts.split(",")):
            dataset = Selection(whole, start, arguments.max_frames) if start or arguments.max_frames else whole
            for odometry in arguments.odometries.split(","):
                frames = DatasetConfig(start=start, max_frames=arguments.max_frames)
                config = Config(odometry=odometry, detector=ALONE, dataset=frames)
                kept = arguments.folder / f"{whole.name}-{odometry}-{start}"
                record(dataset, config, kept)
                for detector in filter(None, arguments.detectors.split(",")):
                    if (whole.name, odometry, str(start), detector) not in done:
                        again = config.with_changes(detector=detector)
                        result = replay(dataset, read_recording(kept), again)
                        write_run(result, dataset, kept.with_name(f"{kept.name}-{detector}"), plots=False)
                        add_row(rows, row_of(result.metrics, start))


def record(dataset: Dataset, config: Config, directory: Path) -> None:
    """Track a sequence, unless that was done before."""
    if directory.exists():
        return
    recording = run(dataset, config).recording
    partial = directory.with_suffix(".partial")
    partial.mkdir(exist_ok=True)
    write_recording(partial, recording)
    partial.rename(directory)
    print(f"recorded {directory.name}", flush=True)


def row_of(metrics: Metrics, start: int) -> Row:
    values: dict[str, object] = {
        "sequence": metrics.sequence,
        "odometry": metrics.odometry,
        "start": start,
        "detector": metrics.detector,
        "alone_m": metrics.odometry_only.ate_rmse_m,
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
        return list(csv.DictReader(file))


def add_row(path: Path, row: Row) -> None:
    fresh = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*KEY, *FIGURES])
        if fresh:
            writer.writeheader()
        writer.writerow(row)
    print(", ".join(row.values()), flush=True)


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
    print("| sequence | odometry | detector | ATE, cm | true/inaccurate/false |\n|---|---|---|---|---|")
    for sequence, odometry, detector in unique((row["sequence"], row["odometry"], row["detector"]) for row in rows):
        inside = [row for row in rows if row["sequence"] == sequence]
        kinds = [sum(errors(inside, odometry, detector, kind).values()) for kind in ("true", "inaccurate", "false")]
        cells = [spread(errors(inside, odometry, detector).values()), "/".join(f"{kind:.0f}" for kind in kinds)]
        print(f"| {' | '.join([sequence, odometry, detector, *cells])} |")


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


def errors(rows: Iterable[Row], odometry: str, detector: str, column: str = "ate_m") -> dict[str, float]:
    """A figure by start."""
    chosen = [row for row in rows if (row["odometry"], row["detector"]) == (odometry, detector)]
    return {row["start"]: float(row[column]) for row in chosen if row[column] != "None"}


def unique(names: Iterable[NameT]) -> list[NameT]:
    return list(dict.fromkeys(names))


def spread(metres: Iterable[float]) -> str:
    known = [100 * value for value in metres]
    if not known:
        return "-"
    if len(known) == 1:
        return f"{known[0]:.1f}"
    return f"{statistics.median(known):.1f} ({min(known):.1f} to {max(known):.1f})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    measuring = commands.add_parser("run")
    measuring.set_defaults(work=measure)
    measuring.add_argument("sequences", nargs="+")
    measuring.add_argument("--folder", type=Path, required=True)
    measuring.add_argument("--odometries", default="feature,dense,kiss,feature_map,dense_keyframe,auto")
    measuring.add_argument("--detectors", default="none,semantic,fused")
    measuring.add_argument("--starts", default="0,2,4,6,8")
    measuring.add_argument("--max-frames", type=int)
    printing = commands.add_parser("table")
    printing.set_defaults(work=print_table)
    printing.add_argument("folder", type=Path)
    listing = commands.add_parser("list")
    listing.set_defaults(work=print_list)
    listing.add_argument("folder", type=Path)
    arguments = parser.parse_args()
    arguments.work(arguments)


if __name__ == "__main__":
    main()
