"""Tracking while people walk through the view, against the same frames without them.

    python benchmarks/people.py [--scene room] [--span 96 160] [--people 1] [--cache DIR]
    python benchmarks/people.py --sequence ../shared/data/redkitchen --photos ../shared/data/nyuv2 --span 0 150

The first renders the people. The second pastes photographed ones, cut out of labelled photos of NYU Depth v2, into a
recording: upright, at a depth of their own, hidden by what is nearer, on a path to and fro before the camera. Each row
is a run without loops, as people are counted in and as ``dynamics.free_space`` leaves them out.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import cv2
import numpy as np

from semslam.config import Config, DatasetConfig
from semslam.datasets import Dataset, open_dataset
from semslam.datasets.selection import ChosenFrames
from semslam.datasets.synthetic.path import smooth
from semslam.datasets.synthetic.walkers import STEP, SWEEP
from semslam.geometry.se3 import FloatArray, invert, transform_points
from semslam.runs.pipeline import run
from semslam.types import Float32Array, Frame, UInt8Array

PERSON = 31
CUT = (("0562", 0.95), ("0567", 1.5))
"""Photos in which one person stands, and the distance in metres at which each walks."""
WIDTH = 0.55
"""Metres of the width of a person."""
DEPTH_SIGMA = 0.003
RIM = np.ones((5, 5), dtype=np.uint8)
"""What a depth camera leaves out at a silhouette."""


@dataclass(frozen=True, slots=True, eq=False)
class CutOut:
    """A photographed person.

    Attributes:
        color: (H, W, 3) uint8 RGB.
        mask: (H, W) float32, 1 on the person.
        relief: (H, W) float32 depth as a share of the person's own.
        metres: of a pixel at the person's depth.
    """

    color: UInt8Array
    mask: Float32Array
    relief: Float32Array
    metres: float


def cut_out(photos: Path, name: str) -> CutOut:
    """The person of a labelled photo."""
    color = cv2.imread(str(photos / f"rgb/{name}.jpg"))
    labels = cv2.imread(str(photos / f"labels40/{name}.png"), cv2.IMREAD_UNCHANGED)
    depth = cv2.imread(str(photos / f"depth/{name}.png"), cv2.IMREAD_UNCHANGED)
    if color is None or labels is None or depth is None:
        raise SystemExit(f"{photos} holds no photo {name} with labels and depth.")
    person = labels == PERSON
    rows, columns = (slice(int(each.min()), int(each.max()) + 1) for each in np.nonzero(person))
    deep = cv2.resize(depth, labels.shape[::-1]).astype(np.float32)
    relief = np.clip(deep / np.median(deep[person]), 0.85, 1.15)[rows, columns]
    shown = np.asarray(color[rows, columns, ::-1], dtype=np.uint8)
    mask = person[rows, columns].astype(np.float32)
    return CutOut(shown, mask, relief, WIDTH / mask.shape[1])


class WithPhotographed(ChosenFrames):
    """A recording through which photographed people walk; the truth of its poses says where they are in an image.

    Args:
        dataset: the recording, with a pose for each frame.
        indices: which of its frames.
        people: the cut-outs.
    """

    def __init__(self, dataset: Dataset, indices: Sequence[int], people: Sequence[CutOut]) -> None:
        super().__init__(dataset, indices)
        truth = dataset.ground_truth
        if truth is None:
            raise SystemExit(f"{dataset.name} has no ground truth.")
        self._people = people
        times = np.array(self.timestamps)
        nearest = np.abs(truth.timestamps[:, None] - times).argmin(0)
        self._poses = truth.poses[nearest]
        knots = np.arange(times[0], times[-1] + 2 * STEP, STEP)
        cameras = self._poses[np.clip(np.searchsorted(times, knots), 0, len(times) - 1)]
        self._places: list[FloatArray] = []
        for number, (_, distance) in zip(range(len(people)), CUT, strict=False):
            bearing = SWEEP * np.sin(np.pi / 2 * np.arange(len(knots)) - np.pi / 2 + 2.1 * number)
            ahead = np.cos(bearing)[:, None] * cameras[:, :3, 2] + np.sin(bearing)[:, None] * cameras[:, :3, 0]
            self._places.append(smooth(knots, cameras[:, :3, 3] + distance * ahead, times))
        self.shares: dict[int, float] = {}

    def frame(self, index: int) -> Frame:
        """A frame with the people in it."""
        frame = super().frame(index)
        T_cam_world = invert(self._poses[index])
        rng = np.random.default_rng([7, index])
        covered = np.zeros(frame.depth.shape, dtype=bool)
        for person, places in zip(self._people, self._places, strict=True):
            place = transform_points(T_cam_world, places[index][None])[0]
            if place[2] > 0.3:
                frame, hidden = pasted(frame, person, place, rng)
                covered |= hidden
        self.shares[index] = float(covered.mean())
        return frame


def pasted(frame: Frame, person: CutOut, place: FloatArray, rng: np.random.Generator) -> tuple[Frame, np.ndarray]:
    """A frame with a person at a place (3,) in the camera's frame, and where the person is seen (H, W)."""
    camera = frame.intrinsics
    scale = camera.fx * person.metres / place[2]
    u, v = camera.project(place[None])[0]
    height, width = person.mask.shape
    A = np.array([[scale, 0, u - scale * width / 2], [0, scale, v - scale * height / 2]])
    size = (camera.width, camera.height)
    alpha = cv2.warpAffine(person.mask, A, size)
    z = np.asarray(cv2.warpAffine(person.relief, A, size) * place[2], dtype=np.float32)
    z += DEPTH_SIGMA * rng.standard_normal(z.shape, dtype=np.float32)
    behind = (frame.depth == 0) | (frame.depth > z)
    alpha *= behind
    inside = cv2.erode(alpha, RIM) > 0.5
    rim = (cv2.dilate(alpha, RIM) > 0.5) & ~inside & behind
    color = cv2.warpAffine(person.color, A, size)
    mixed = frame.color * (1 - alpha[..., None]) + color * alpha[..., None]
    depth = np.where(inside, z, np.where(rim, np.float32(0), frame.depth))
    return replace(frame, color=np.rint(mixed).astype(np.uint8), depth=depth), alpha > 0.5


def row(dataset: Dataset, people: str, free_space: bool) -> str:
    """A run's row."""
    config = Config().with_changes(detector="none", dynamics={"free_space": free_space})
    metrics = run(dataset, config).metrics
    live, final = metrics.odometry_only.ate_rmse_m, metrics.optimized.ate_rmse_m
    errors = ["-" if error is None else f"{100 * error:.2f}" for error in (live, final)]
    cells = [people, "left out" if free_space else "counted in", *errors, f"{metrics.tracked} of {metrics.frames}"]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="room")
    parser.add_argument("--sequence", type=Path)
    parser.add_argument("--photos", type=Path)
    parser.add_argument("--span", type=int, nargs=2, default=[96, 160])
    parser.add_argument("--people", type=int, nargs="+", default=[1])
    parser.add_argument("--cache", type=Path)
    arguments = parser.parse_args()
    if arguments.sequence and not arguments.photos:
        parser.error("--sequence needs --photos")
    indices, share = range(*arguments.span), 0.0
    print("| people | they are | live ATE, cm | final ATE, cm | tracked |\n|---|---|---|---|---|")
    for count, free_space in product((0, *arguments.people), (False, True)):
        if arguments.sequence:
            people = [cut_out(arguments.photos, name) for name, _ in CUT[:count]]
            photographed = WithPhotographed(open_dataset(arguments.sequence), indices, people)
            print(row(photographed, str(count), free_space), flush=True)
            share = max(share, *photographed.shares.values())
        else:
            rendered = open_dataset(
                f"synthetic:{arguments.scene}?people={count}", DatasetConfig(cache_dir=arguments.cache)
            )
            print(row(ChosenFrames(rendered, indices), str(count), free_space), flush=True)
    if share:
        print(f"People cover up to {share:.0%} of an image.")


if __name__ == "__main__":
    main()
