"""Choosing pairs of frames out of a posed sequence, in the three groups of the paper's Table 2.

Half of each group shows the same place; the other half are the pairs of different places whose colours look most
alike, with the same changes done to them.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import cv2
import numpy as np
import numpy.typing as npt

from semslam.eval.loops.truth import TRUE_OVERLAP, LoopTruth
from semslam.eval.pairs.changes import LIGHT, MIN_OBJECT, Change, change_frame
from semslam.eval.pairs.judging import Pair, PairGroup
from semslam.eval.trajectory import BoolArray
from semslam.geometry.se3 import FloatArray, Transforms, invert, rotation_angle
from semslam.types import Frame

PAIRS_PER_GROUP = 50
HISTOGRAM_BINS = (16, 8)
USES = 2
# What a change of the world must at least do to a frame: levels of a colour, or metres of depth, on a share of it.
COLOR_STEP = 12
DEPTH_STEP = 0.1

Reader = Callable[[int], Frame]
"""Reads frame 0..N-1 of a choice."""


@dataclass(frozen=True, slots=True, eq=False)
class Variant:
    """The same frames in a changed world: a change in a few words, and what reads them."""

    kind: str
    read: Reader


@dataclass(frozen=True, slots=True, eq=False)
class PosedFrames:
    """The frames of a sequence that pairs are chosen from.

    Attributes:
        read: reads them unchanged.
        poses: (N, 4, 4) true T_world_cam.
        truth: their loop truth, with all pairs known (``min_gap`` 0).
        min_gap: seconds between the frames of viewpoint pairs and of hard negatives.
        variants: how the world was changed for a group; the images are changed where nothing stands here.
    """

    read: Reader
    poses: Transforms
    truth: LoopTruth
    min_gap: float = 5.0
    variants: Mapping[PairGroup, Sequence[Variant]] = field(default_factory=dict)


def choose_pairs(frames: PosedFrames, count: int = PAIRS_PER_GROUP, seed: int = 0) -> list[Pair]:
    """Up to ``count`` pairs of each group, half of them the same place; deterministic for a seed."""
    variants = {group: frames.variants.get(group) or _image_variants(frames.read, group, seed) for group in PairGroup}
    survey = [_survey(frames.read(i), i, variants) for i in range(len(frames.poses))]
    histograms = np.stack([histogram for histogram, _ in survey])
    pairs: list[Pair] = []
    for group in PairGroup:
        changes = np.array([shown[group] for _, shown in survey])
        find_same = _viewpoints if group is PairGroup.VIEWPOINT else _neighbours
        alike = _look_alikes(frames, histograms, changes, count // 2)
        same = find_same(frames, changes, len(alike))
        for same_place, chosen in ((True, same), (False, alike[: len(same)])):
            for i, pair in enumerate(chosen):
                pairs.append(_pair(frames, group, variants[group][i % len(variants[group])], pair, same_place))
    return pairs


def _image_variants(read: Reader, group: PairGroup, seed: int) -> list[Variant]:
    changes = {PairGroup.VIEWPOINT: (Change.NONE,), PairGroup.ILLUMINATION: LIGHT, PairGroup.OBJECTS: (Change.REMOVED,)}
    return [Variant(change.value, partial(_changed, read, change, seed)) for change in changes[group]]


def _changed(read: Reader, change: Change, seed: int, index: int) -> Frame:
    return change_frame(read(index), change, seed * 1_000_003 + index)


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


def _survey(
    frame: Frame, index: int, variants: Mapping[PairGroup, Sequence[Variant]]
) -> tuple[FloatArray, dict[PairGroup, bool]]:
    """Shares (128,) of hues and saturations, and for which groups the frame is fit: those whose change it shows."""
    hsv = cv2.cvtColor(np.ascontiguousarray(frame.color), cv2.COLOR_RGB2HSV)
    counts = cv2.calcHist([hsv], [0, 1], None, list(HISTOGRAM_BINS), [0, 180, 0, 256]).ravel()
    shown = {
        group: group is PairGroup.VIEWPOINT or _differs(frame, variants[group][0].read(index)) for group in PairGroup
    }
    return np.asarray(counts / counts.sum(), dtype=np.float64), shown


def _differs(before: Frame, after: Frame) -> bool:
    if after is before:
        return False
    colors = cv2.absdiff(before.color, after.color).max(axis=2) > COLOR_STEP
    depths = (np.abs(before.depth - after.depth) > DEPTH_STEP) & (before.depth > 0)
    return max(float(colors.mean()), float(depths.mean())) >= MIN_OBJECT


def _spread(values: npt.NDArray[np.int64], count: int) -> list[int]:
    """At most ``count`` of the values, evenly spaced in their order."""
    places = np.linspace(0, len(values) - 1, min(count, len(values))).round().astype(np.int64)
    return [int(value) for value in values[places]] if len(values) else []


def _pair(frames: PosedFrames, group: PairGroup, variant: Variant, pair: tuple[int, int], same_place: bool) -> Pair:
    poses = frames.poses[list(pair)]
    motion = invert(poses[0]) @ poses[1]
    moved = f"{np.linalg.norm(motion[:3, 3]):.2f} m, {np.degrees(rotation_angle(motion)):.0f}°"
    kind = moved if group is PairGroup.VIEWPOINT else variant.kind
    return Pair(group, kind, same_place, partial(_load, (frames.read, variant.read), pair), poses)


def _load(readers: tuple[Reader, Reader], pair: tuple[int, int], side: int) -> Frame:
    return readers[side](pair[side])
