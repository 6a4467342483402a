"""Classification of frame pairs as same place or hard negative (the paper's Table 2), from sequences or a folder."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semslam.config import Config
from semslam.datasets import SYNTHETIC, guess_loader, open_dataset
from semslam.datasets.dataset import Dataset
from semslam.errors import ConfigError, DatasetError
from semslam.eval.loops.truth import find_loop_truth, make_view
from semslam.eval.pairs.choice import PosedFrames, Reader, Variant, choose_pairs
from semslam.eval.pairs.judging import (
    Pair,
    PairGroup,
    PairQuality,
    ScoredPairs,
    find_thresholds,
    judge_pairs,
    score_pairs,
)
from semslam.eval.pairs.reader import read_pair_folder
from semslam.eval.trajectory import poses_at
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.geometry.se3 import FloatArray, Transform, invert
from semslam.loop.detectors.fused.settings import FusedConfig
from semslam.loop.segmentation.build import build_segmenter
from semslam.studies.detectors import PROBABILISTIC, check_scorable, exhaustive_detector
from semslam.types import Frame, KeyframeView

TUNING_SCENE = "synthetic:house"
"""What the threshold comes from where nothing else is given."""

Report = Callable[[str, int, int], None]
"""Called with the set that is worked on, how many frames are done, and of how many."""


@dataclass(frozen=True, slots=True)
class PairPlan:
    """The pairs and detectors of a trial.

    Attributes:
        sequences: paths of sequences with ground truth.
        folders: folders with a list of pairs.
        tuning: sequences that the thresholds come from. Without any they come from all the sets but the one that is
            judged, or from the rendered house where there is but one.
        every: frames of a sequence from one that may be chosen to the next.
        count: pairs of each group of a sequence.
    """

    sequences: tuple[str, ...]
    folders: tuple[Path, ...] = ()
    tuning: tuple[str, ...] = ()
    every: int = 5
    count: int = 50

    @property
    def tuning_sequences(self) -> tuple[str, ...]:
        """Sequences used for thresholds only; empty where each set takes its threshold from the others."""
        alone = len(self.sequences) + len(self.folders) == 1
        return self.tuning or ((TUNING_SCENE,) if alone else ())


@dataclass(frozen=True, slots=True, eq=False)
class PairTrial:
    """The result of a trial.

    Attributes:
        tested: the judged sets.
        thresholds: each detector's threshold for each of them.
        qualities: accuracies over all sets, in the order of the detectors.
    """

    tested: tuple[ScoredPairs, ...]
    thresholds: Mapping[str, Sequence[float]]
    qualities: tuple[PairQuality, ...]


def try_pairs(
    plan: PairPlan, config: Config, names: Sequence[str], report: Report = lambda _set, _done, _all: None
) -> PairTrial:
    """Choose pairs, score them by each detector, and judge the scores at thresholds from other data.

    Raises:
        ConfigError: there is nothing to try, a name is unknown, or labels come from a folder of images.
        DatasetError: a sequence has no ground truth or gives no pairs, or a list is malformed.
    """
    if not plan.sequences and not plan.folders:
        raise ConfigError("Name a sequence or a folder of pairs.")
    if config.segmentation.name == "folder":
        raise ConfigError("The segmenter 'folder' has no labels for frames that the test changes; choose another.")
    check_scorable(names)

    def scored(name: str, pairs: Sequence[Pair]) -> ScoredPairs:
        if not pairs:
            raise DatasetError(f"{name} gives no pairs: no two of its frames certainly show different places.")
        return ScoredPairs(name, pairs, _scores(name, pairs, config, names, report))

    def of_sequence(path: str) -> ScoredPairs:
        return scored(*sequence_pairs(path, config, plan.every, plan.count, report))

    folders = [scored(folder.name, read_pair_folder(folder)) for folder in plan.folders]
    tested = (*map(of_sequence, plan.sequences), *folders)
    own = {PROBABILISTIC: config.section(PROBABILISTIC, FusedConfig).min_probability}
    thresholds = find_thresholds(tested, [of_sequence(path) for path in plan.tuning_sequences], own)
    return PairTrial(tested, thresholds, tuple(judge_pairs(tested, thresholds)))


def sequence_pairs(
    path: str, config: Config, every: int, count: int, report: Report = lambda _set, _done, _all: None
) -> tuple[str, list[Pair]]:
    """The sequence's name and its pairs; in a rendered scene light and objects are changed in the scene itself.

    Poses of the pairs are relative to the first chosen frame, as those of odometry are.

    Raises:
        DatasetError: the sequence has no ground truth, or an image cannot be read.
    """
    dataset = open_dataset(path, config.dataset)
    if dataset.ground_truth is None:
        raise DatasetError(f"{dataset.name} has no ground truth, which is needed to choose pairs.")
    chosen = range(0, len(dataset), every)
    stamps = [dataset.timestamps[index] for index in chosen]
    poses, covered = poses_at(dataset.ground_truth, stamps)
    if not covered.any():
        raise DatasetError(f"The ground truth of {dataset.name} covers none of its frames.")
    depths = []
    for done, index in enumerate(chosen):
        report(dataset.name, done, len(chosen))
        frame = dataset.frame(index)
        depths.append(make_view(frame.depth, frame.intrinsics))
    truth = find_loop_truth(stamps, depths, dataset.ground_truth, min_gap=0.0)
    relative = invert(poses[int(np.argmax(covered))]) @ poses
    variants = _rendered_variants(path, config, chosen) if _is_rendered(path, config) else {}
    frames = PosedFrames(_reader(dataset, chosen), relative, truth, config.loops.min_gap, variants)
    return dataset.name, choose_pairs(frames, count, config.seed)


def _is_rendered(path: str, config: Config) -> bool:
    return (config.dataset.loader or guess_loader(path)) == SYNTHETIC


def _rendered_variants(path: str, config: Config, chosen: range) -> dict[PairGroup, list[Variant]]:
    """Readers of the same walk through a scene whose light, or whose things, are others on the second pass."""
    from semslam.datasets.synthetic.dataset import LIGHTS

    def variant(kind: str, switch: str) -> Variant:
        changed = open_dataset(f"{path}{'&' if '?' in path else '?'}{switch}", config.dataset)
        return Variant(kind, _reader(changed, chosen))

    lights = [variant(f"{name} light", f"light={name}") for name in LIGHTS if name != "same"]
    return {PairGroup.ILLUMINATION: lights, PairGroup.OBJECTS: [variant("things moved", "moved=true")]}


def _reader(dataset: Dataset, chosen: range) -> Reader:
    return lambda index: dataset.frame(chosen[index])


def _scores(
    title: str, pairs: Sequence[Pair], config: Config, names: Sequence[str], report: Report
) -> dict[str, FloatArray]:
    detectors = {name: exhaustive_detector(name, config, len(pairs)) for name in names}
    segmenter = build_segmenter(config) if any(d.needs_labels for d in detectors.values()) else None
    builder = KeyframeBuilder(config, details=False)

    def make(identity: int, frame: Frame, T_world_cam: Transform) -> KeyframeView:
        report(title, identity, 2 * len(pairs))
        keyframe = builder.build_at(frame, T_world_cam)
        labels = None if segmenter is None else segmenter.segment(frame.color, frame.depth, frame.source_index)
        return KeyframeView(keyframe, frame.color, frame.depth, labels)

    return score_pairs(detectors, pairs, make)
