"""What the calls of ``LoopCloser`` cost a live program, in milliseconds of wall time.

    python benchmarks/loop_closer.py SEQUENCE [--every 10] [--detectors fused,dbow,semantic]

Every tenth frame is a keyframe with its true pose. ``add`` is measured in the caller's thread, and as it returns with
a process beside the caller, which is given a third of a second for each keyframe. Then, with all keyframes in memory:
``query`` of each fifth of them, ``save``, ``load``, and ``forget`` of one keyframe.
"""

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from semslam import LoopCloser
from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.types import Frame

PERIOD = 1 / 3


def timed(call: Callable[[], object]) -> float:
    """Milliseconds that a call takes."""
    began = time.perf_counter()
    call()
    return 1e3 * (time.perf_counter() - began)


def add(closer: LoopCloser, frames: Sequence[Frame], period: float) -> list[float]:
    """Milliseconds of each ``add``; the next one follows no sooner than a period in seconds."""
    spent = []
    for number, frame in enumerate(frames):
        began = time.perf_counter()
        spent.append(timed(lambda f=frame, n=number: closer.add(n, f.color, f.depth, timestamp=f.timestamp)))  # type: ignore[misc]
        time.sleep(max(0.0, period - (time.perf_counter() - began)))
    closer.poll(wait=True)
    return spent


def quantiles(spent: Sequence[float]) -> str:
    """Median and 95 % quantile, without the first call, which loads libraries."""
    median, p95 = np.quantile(spent[1:], [0.5, 0.95])
    return f"{median:.1f} / {p95:.1f}"


def row(dataset: Dataset, detector: str, every: int) -> str:
    """A row of the table."""
    frames = [dataset.frame(index) for index in range(0, len(dataset), every)]
    beside = LoopCloser(dataset.intrinsics, detector, worker="process")
    beside.query(frames[0].color, frames[0].depth)  # the process has started
    returned = add(beside, frames, PERIOD)
    beside.close()
    closer, other = (LoopCloser(dataset.intrinsics, detector) for _ in range(2))
    inside = add(closer, frames, 0.0)
    asked = [timed(lambda f=frame: closer.query(f.color, f.depth)) for frame in frames[::5]]  # type: ignore[misc]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "database"
        saved = timed(lambda: closer.save(path))
        loaded, size = timed(lambda: other.load(path)), path.stat().st_size / 1e6
    forgotten = timed(lambda: closer.forget([0]))
    cells = (detector, str(len(frames)), quantiles(inside), quantiles(returned), quantiles(asked))
    rest = (f"{saved:.0f}", f"{loaded:.0f}", f"{size:.0f}", f"{forgotten:.1f}")
    return " | ".join(("", *cells, *rest, "")).strip()


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence")
    parser.add_argument("--every", type=int, default=10)
    parser.add_argument("--detectors", default="fused,semantic,dbow")
    arguments = parser.parse_args()
    dataset = open_dataset(arguments.sequence)
    print("| detector | keyframes | `add` | `add`, beside | `query` | `save` | `load` | MB | `forget` |")
    print("|---|---|---|---|---|---|---|---|---|")
    for detector in arguments.detectors.split(","):
        print(row(dataset, detector, arguments.every), flush=True)


if __name__ == "__main__":
    main()
