"""Compares loop detectors on a sequence's keyframes with loop truth (the paper's Figure 13)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from semslam import plugins
from semslam.config import Config
from semslam.datasets.dataset import Dataset
from semslam.datasets.prefetch import prefetch
from semslam.errors import ConfigError, DatasetError
from semslam.eval.loops.precision_recall import (
    Contestant,
    Curve,
    DetectorQuality,
    collect_scores,
    curve_of,
    judge_detector,
)
from semslam.eval.loops.reliability import ScoreBin, reliability_of
from semslam.eval.loops.truth import DepthView, find_loop_truth, make_view
from semslam.frontend.keyframes import EveryNth, KeyframeBuilder
from semslam.loop.detector import LoopDetector
from semslam.loop.segmentation.build import build_segmenter
from semslam.types import KeyframeView

PROBABILISTIC = "fused"
"""The detector whose score is a probability."""

Report = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, eq=False)
class DetectorComparison:
    """Detectors on one sequence.

    Attributes:
        qualities: metrics, in the order of the names.
        curves: precision and recall by detector.
        reliabilities: share of true pairs by score, by detector.
        features_from: which weights a detector's features are of, by detector, where it has a choice of them.
    """

    qualities: tuple[DetectorQuality, ...]
    curves: dict[str, Curve]
    reliabilities: dict[str, tuple[ScoreBin, ...]]
    features_from: dict[str, str]


def compare_detectors(
    dataset: Dataset, config: Config, names: Sequence[str], every: int, report: Report = lambda _done, _total: None
) -> DetectorComparison:
    """Score all pairs of every ``every``-th frame by each detector and judge the scores by view overlap.

    Args:
        dataset: needs ground truth; frames are tracked by the configured odometry, as detectors may use its poses.
        config: settings of everything but the detector.
        names: registered detectors.
        every: frames from one keyframe to the next.
        report: called with frames done and in all.

    Raises:
        ConfigError: a name is unknown.
        DatasetError: the sequence has no ground truth.
    """
    if dataset.ground_truth is None:
        raise DatasetError(f"{dataset.name} has no ground truth, which loop truth is computed from.")
    contestants = {name: _contestant(name, config, 1 + len(dataset) // every) for name in names}
    needs_labels = any(plugins.load("semslam.detectors", name).needs_labels for name in names)
    depths: list[DepthView] = []
    stamps: list[float] = []

    def watched() -> Iterator[KeyframeView]:
        for view in keyframe_views(dataset, config, every, needs_labels, report):
            depths.append(make_view(view.depth, view.keyframe.intrinsics))
            stamps.append(view.keyframe.timestamp)
            yield view

    answers = collect_scores(contestants, watched())
    truth = find_loop_truth(stamps, depths, dataset.ground_truth, config.loops.min_gap)
    qualities = tuple(judge_detector(name, answers[name], truth) for name in names)
    return DetectorComparison(
        qualities,
        {name: curve_of(answers[name].scores, truth) for name in names},
        {name: reliability_of(answers[name].scores, truth) for name in names},
        {
            name: str(c.ordinary.features_from)
            for name, c in contestants.items()
            if hasattr(c.ordinary, "features_from")
        },
    )


def keyframe_views(
    dataset: Dataset, config: Config, every: int, needs_labels: bool, report: Report = lambda _done, _total: None
) -> Iterator[KeyframeView]:
    """Every ``every``-th frame as a keyframe with its images, tracked by the configured odometry, lost ones excepted.

    Raises:
        DatasetError: a keyframe's image cannot be read.
    """
    odometry = plugins.load("semslam.odometry", config.odometry).from_config(config)
    segmenter = build_segmenter(config) if needs_labels else None
    builder = KeyframeBuilder(config, EveryNth(every))
    for index, frame in enumerate(prefetch(dataset)):
        report(index + 1, len(dataset))
        if isinstance(frame, DatasetError):
            if index % every == 0:
                raise frame
            continue
        if builder.advance(index, frame.timestamp, odometry.track(frame)):
            keyframe = builder.build(frame)
            labels = None if segmenter is None else segmenter.segment(frame.color, frame.depth, frame.source_index)
            yield KeyframeView(keyframe, frame.color, frame.depth, labels)


def check_scorable(names: Sequence[str]) -> None:
    """Check before long work that all detectors can be scored.

    Raises:
        ConfigError: a name is unknown, or is "none", which scores nothing.
    """
    for name in names:
        plugins.load("semslam.detectors", name)
        if name == "none":
            raise ConfigError("The detector 'none' proposes nothing that could be scored.")


def exhaustive_detector(name: str, config: Config, keyframes: int) -> LoopDetector:
    """The detector ``name``, set to propose every pair of ``keyframes`` keyframes that it scores above 0.

    Raises:
        ConfigError: the name is unknown, or is "none", which scores nothing.
    """
    check_scorable([name])
    everything = config.loops.model_copy(update={"max_candidates": max(keyframes, 1), "min_score": 0.0})
    return plugins.load("semslam.detectors", name).from_config(config.with_changes(loops=everything))


def _contestant(name: str, config: Config, keyframes: int) -> Contestant:
    return Contestant(
        exhaustive=exhaustive_detector(name, config, keyframes),
        ordinary=plugins.load("semslam.detectors", name).from_config(config),
    )
