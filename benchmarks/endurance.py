"""A day's worth of frames: whether memory, threads and open files grow with the frames of a run.

    python benchmarks/endurance.py SEQUENCE [--frames 10000] [--width 160] [--odometry feature_map] [--detector none]
        [--every 1000] [--set section.key=value]

The sequence is run forwards and backwards, again and again, in one run of so many frames (50 000 are 28 minutes at 30
frames a second), its images reduced to ``--width``. Every ``--every`` frames a line of a Markdown table states what the
process holds, and the tracking thread's processor time for a frame since the line before (99 % of the frames, and the
worst); the last lines give the growth from the middle of the run to its end, where caches are full.
"""

import argparse
import gc
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from semslam.config import load_config, parse_overrides
from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.runs.pipeline import run
from semslam.system.result import FrameState
from semslam.types import Frame, Intrinsics, Trajectory

REPORTED = {"time", "maps", "loops", "odometry_only", "live", "optimized"}


class Palindrome:
    """A sequence forwards and backwards until it has ``frames`` frames, its images reduced to ``width``."""

    def __init__(self, dataset: Dataset, frames: int, width: int) -> None:
        self._dataset, self._frames = dataset, frames
        there = list(range(len(dataset)))
        self._order = there + there[-2:0:-1]
        camera, factor = dataset.intrinsics, width / dataset.intrinsics.width
        self._size = (width, round(camera.height * factor))
        self.intrinsics = Intrinsics(
            *self._size,
            camera.fx * factor,
            camera.fy * factor,
            (camera.cx + 0.5) * factor - 0.5,
            (camera.cy + 0.5) * factor - 0.5,
        )
        self.name = f"{dataset.name}-palindrome"
        self.timestamps = [index / 30 for index in range(frames)]
        self.ground_truth = self._truth(dataset.ground_truth)

    def _truth(self, truth: Trajectory | None) -> Trajectory | None:
        """Where the camera is at each frame that has ground truth within 20 ms."""
        if truth is None:
            return None
        stamps = np.array(self._dataset.timestamps)
        nearest = np.abs(truth.timestamps[None] - stamps[:, None]).argmin(1)
        known = np.abs(truth.timestamps[nearest] - stamps) < 0.02
        order = np.resize(self._order, self._frames)
        seen = known[order]
        return Trajectory(np.array(self.timestamps)[seen], truth.poses[nearest[order[seen]]])

    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return self._frames

    def frame(self, index: int) -> Frame:
        """A frame of the source, reduced."""
        frame = self._dataset.frame(self._order[index % len(self._order)])
        color = cv2.resize(frame.color, self._size, interpolation=cv2.INTER_AREA)
        depth = cv2.resize(frame.depth, self._size, interpolation=cv2.INTER_NEAREST)
        stamp = self.timestamps[index]
        return replace(frame, index=index, timestamp=stamp, color=color, depth=depth, intrinsics=self.intrinsics)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(self._frames))


@dataclass(frozen=True, slots=True)
class Sample:
    """What the process holds after so many frames."""

    frames: int
    keyframes: int
    megabytes: float
    threads: int
    files: int
    objects: int
    p99_ms: float
    worst_ms: float

    def __str__(self) -> str:
        times = f"{self.p99_ms:.1f}", f"{self.worst_ms:.1f}"
        values = (self.frames, self.keyframes, f"{self.megabytes:.1f}", self.threads, self.files, self.objects, *times)
        return f"| {' | '.join(map(str, values))} |"


def resident_megabytes() -> float:
    text = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) / 1024 for line in text.splitlines() if line.startswith("VmRSS"))


def measure(dataset: Palindrome, arguments: argparse.Namespace) -> list[Sample]:
    """Run, and look at the process every so many frames."""
    config = load_config(None, parse_overrides(arguments.set))
    config = config.with_changes(odometry=arguments.odometry, detector=arguments.detector)
    samples: list[Sample] = []
    keyframes, before = 0, time.thread_time()
    spent: list[float] = []

    def look(index: int, state: FrameState | None) -> None:
        nonlocal keyframes, before
        spent.append(1e3 * (time.thread_time() - before))
        keyframes += state is not None and state.keyframe is not None
        if (index + 1) % arguments.every == 0:
            gc.collect()
            held = (threading.active_count(), len(list(Path("/proc/self/fd").iterdir())), len(gc.get_objects()))
            times = float(np.quantile(spent, 0.99)), max(spent)
            samples.append(Sample(index + 1, keyframes, resident_megabytes(), *held, *times))
            print(samples[-1], flush=True)
            spent.clear()
        before = time.thread_time()

    print(f"\n{run(dataset, config, look).metrics.model_dump_json(include=REPORTED)}")
    return samples


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence")
    parser.add_argument("--frames", type=int, default=10_000)
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--odometry", default="feature_map")
    parser.add_argument("--detector", default="none")
    parser.add_argument("--every", type=int, default=1000)
    parser.add_argument("--set", action="append", default=[])
    arguments = parser.parse_args()
    dataset = Palindrome(open_dataset(arguments.sequence), arguments.frames, arguments.width)
    titles = "frames", "keyframes", "resident MB", "threads", "open files", "Python objects", "p99 ms", "worst ms"
    print(f"| {' | '.join(titles)} |\n|{'---|' * len(titles)}")
    samples = measure(dataset, arguments)
    middle, last = samples[len(samples) // 2 - 1], samples[-1]
    frames, kilobytes = last.frames - middle.frames, 1024 * (last.megabytes - middle.megabytes)
    print(f"\nFrom frame {middle.frames} to {last.frames}: {kilobytes / frames:.2f} kB per frame,")
    print(f"{kilobytes / max(1, last.keyframes - middle.keyframes):.1f} kB per keyframe,")
    print(f"{(last.objects - middle.objects) / frames:.2f} Python objects per frame,")
    print(f"{last.threads - middle.threads} threads, {last.files - middle.files} open files.")


if __name__ == "__main__":
    np.seterr(all="ignore")
    main()
