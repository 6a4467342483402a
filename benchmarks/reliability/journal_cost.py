"""What a run's journal costs: wall time with and without it, and the time spent in it.

    python -m benchmarks.reliability.journal_cost SEQUENCE [--frames 300] [--repeats 3] [--detector fused]

Runs with and without a journal take turns; medians are printed.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.runs.journal import Journal, JournalHeader
from semslam.runs.pipeline import run


class TimedJournal(Journal):
    """A journal that adds up the time its calls take."""

    def __init__(self, path: Path, header: JournalHeader) -> None:
        self.seconds = 0.0
        super().__init__(path, header)

    def frame(self, *arguments: Any) -> None:
        """See ``Journal``."""
        self._timed(super().frame, *arguments)

    def outcomes(self, *arguments: Any) -> None:
        """See ``Journal``."""
        self._timed(super().outcomes, *arguments)

    def _timed(self, call: Callable[..., None], *arguments: Any) -> None:
        begin = time.perf_counter()
        call(*arguments)
        self.seconds += time.perf_counter() - begin


def one(dataset: Dataset, config: Config, path: Path | None) -> tuple[float, float]:
    """Seconds of a run, and of these in the journal."""
    journal = None if path is None else TimedJournal(path, JournalHeader.of(config, "sequence", False, None, ()))
    begin = time.perf_counter()
    run(dataset, config, journal=journal)
    wall = time.perf_counter() - begin
    if journal is not None:
        journal.close()
    return wall, 0.0 if journal is None else journal.seconds


def median(values: Sequence[float]) -> float:
    return statistics.median(values)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--detector", default=Config().detector)
    arguments = parser.parse_args()
    config = Config().with_changes(detector=arguments.detector, dataset={"max_frames": arguments.frames})
    dataset = open_dataset(arguments.sequence, config.dataset)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "journal"
        one(dataset, config, None)  # fills caches
        pairs = [(one(dataset, config, None)[0], *one(dataset, config, path)) for _ in range(arguments.repeats)]
        size = path.stat().st_size
    without, with_it, inside = (median(values) for values in zip(*pairs, strict=True))
    print(f"{len(dataset)} frames, medians of {arguments.repeats}: {without:.2f} s without, {with_it:.2f} s with a")
    print(f"journal of {size / 1000:.0f} kB ({100 * (with_it / without - 1):+.1f} %);")
    print(f"{1000 * inside:.1f} ms spent in it ({100 * inside / with_it:.2f} % of the wall time).")


if __name__ == "__main__":
    main()
