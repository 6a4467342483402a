"""Choosing pairs of frames out of a posed sequence, in the three groups of the paper's Table 2.

Half of each group shows the same place; the other half are the pairs of different places whose colours look most
alike, with the same changes done to them.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from eval.changes import LIGHT, Change, change_frame, find_object
from eval.loop_truth import TRUE_OVERLAP, LoopTruth
from eval.pairs import Pair, PairGroup
from eval.trajectory import BoolArray
from semslam.geometry import FloatArray, invert, rotation_angle
from semslam.types import Frame

PAIRS_PER_GROUP = 50
HISTOGRAM_BINS = (16, 8)
USES = 2


@dataclass(frozen=True, slots=True, eq=False)
class PosedFrames:
    """The frames of a sequence that pairs are chosen from.

    Attributes:
        read: reads frame 0..N-1 of the choice.
        poses: (N, 4, 4) true T_world_cam.
        truth: their loop truth, with all pairs known (``min_gap`` 0).
        min_gap: seconds between the frames of viewpoint pairs and of look-alikes.
    """

    read: Callable[[int], Frame]
    poses: FloatArray
    truth: LoopTruth
    min_gap: float = 5.0


def choose_pairs(frames: PosedFrames, count: int = PAIRS_PER_GROUP, seed: int = 0) -> list[Pair]:
    """Up to ``count`` pairs of each group, half of them the same place; deterministic for a seed."""
    survey = [_survey(frames.read(i)) for i in range(len(frames.poses))]
    histograms = np.stack([histogram for histogram, _ in survey])
    has_object = np.array([shown for _, shown in survey])
    anything = np.ones_like(has_object)
    pairs: list[Pair] = []
    for group, wanted in (
        (PairGroup.VIEWPOINT, anything),
        (PairGroup.ILLUMINATION, anything),
        (PairGroup.OBJECTS, has_object),
    ):
        alike = _look_alikes(frames, histograms, wanted, count // 2)
        same = _viewpoints if group is PairGroup.VIEWPOINT else _neighbours
        for same_place, chosen in ((True, same(frames, wanted, len(alike))), (False, alike)):
            for i, pair in enumerate(chosen):
                pairs.append(_pair(frames, group, pair, same_place, _change(group, i), seed))
    return pairs


def _change(group: PairGroup, index: int) -> Change:
    if group is PairGroup.VIEWPOINT:
        return Change.NONE
    return Change.REMOVED if group is PairGroup.OBJECTS else LIGHT[index % len(LIGHT)]


def _far(frames: PosedFrames) -> BoolArray:
    stamps = frames.truth.timestamps
    return np.asarray(stamps[:, None] - stamps[None, :] >= frames.min_gap - 1e-9)


def _viewpoints(frames: PosedFrames, wanted: BoolArray, count: int) -> list[tuple[int, int]]:
    """True pairs, spread evenly over how far the view has moved and turned (metres plus radians)."""
    rows, columns = np.nonzero(frames.truth.true_pairs & _far(frames) & wanted[:, None])
    motion = invert(frames.poses[columns]) @ frames.poses[rows]
    change = np.linalg.norm(motion[:, :3, 3], axis=1) + rotation_angle(motion)
    return [(int(columns[i]), int(rows[i])) for i in _spread(np.argsort(change, kind="stable"), count)]


def _neighbours(frames: PosedFrames, wanted: BoolArray, count: int) -> list[tuple[int, int]]:
    """Frames and the next one that still shows the same place, spread over the sequence."""
    both = np.minimum(frames.truth.overlap, frames.truth.overlap.T)
    fit = [i for i in range(len(both) - 1) if wanted[i + 1] and both[i, i + 1] >= TRUE_OVERLAP]
    return [(i, i + 1) for i in _spread(np.array(fit, dtype=np.int64), count)]


def _look_alikes(frames: PosedFrames, histograms: FloatArray, wanted: BoolArray, count: int) -> list[tuple[int, int]]:
    """The false pairs whose colours are most alike, no frame more than twice on either side."""
    rows, columns = np.nonzero(frames.truth.false_pairs & _far(frames) & wanted[:, None])
    likeness = np.minimum(histograms[rows], histograms[columns]).sum(axis=1)
    uses: Counter[tuple[str, int]] = Counter()
    chosen: list[tuple[int, int]] = []
    for at in np.argsort(-likeness, kind="stable"):
        query, match = int(rows[at]), int(columns[at])
        sides = (("query", query), ("match", match))
        if len(chosen) < count and all(uses[side] < USES for side in sides):
            uses.update(sides)
            chosen.append((match, query))
    return chosen


def _survey(frame: Frame) -> tuple[FloatArray, bool]:
    """Shares (128,) of hues and saturations, and whether an object could be removed."""
    hsv = cv2.cvtColor(np.ascontiguousarray(frame.color), cv2.COLOR_RGB2HSV)
    counts = cv2.calcHist([hsv], [0, 1], None, list(HISTOGRAM_BINS), [0, 180, 0, 256]).ravel()
    return np.asarray(counts / counts.sum(), dtype=np.float64), bool(find_object(frame.depth).any())


def _spread(values: npt.NDArray[np.int64], count: int) -> list[int]:
    """At most ``count`` of the values, evenly spaced in their order."""
    places = np.linspace(0, len(values) - 1, min(count, len(values))).round().astype(np.int64)
    return [int(value) for value in values[places]] if len(values) else []


def _pair(
    frames: PosedFrames, group: PairGroup, pair: tuple[int, int], same_place: bool, change: Change, seed: int
) -> Pair:
    poses = frames.poses[list(pair)]
    motion = invert(poses[0]) @ poses[1]
    moved = f"{np.linalg.norm(motion[:3, 3]):.2f} m, {np.degrees(rotation_angle(motion)):.0f}°"
    kind = moved if change is Change.NONE else change.value
    return Pair(group, kind, same_place, partial(_load, frames.read, pair, change, seed), poses)


def _load(read: Callable[[int], Frame], pair: tuple[int, int], change: Change, seed: int, side: int) -> Frame:
    frame = read(pair[side])
    return change_frame(frame, change, seed * 1_000_003 + pair[1]) if side else frame
