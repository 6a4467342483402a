"""Same place or hard negative: detectors on pairs of frames (paper, section 4.3, Table 2).

The pairs come from ``semslam.eval.pairs.choice`` or ``semslam.eval.pairs.reader``; the threshold always from other
sequences.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol

import numpy as np

from semslam.errors import ConfigError
from semslam.eval.loops.precision_recall import Scorer
from semslam.eval.trajectory import BoolArray
from semslam.geometry.se3 import FloatArray, Transform, Transforms
from semslam.types import Frame, KeyframeView

# Seconds between the stamps of handed-out frames: far enough for every detector's idea of "the same moment".
APART = 1000.0


class PairGroup(StrEnum):
    """The three columns of the paper's Table 2."""

    VIEWPOINT = "viewpoint"
    ILLUMINATION = "illumination"
    OBJECTS = "objects"


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Two frames and whether they show the same place.

    Attributes:
        group: which change it is about.
        kind: the change in a few words.
        same_place: truth.
        load: reads frame 0, which is remembered, or frame 1, which is changed and asked for.
        poses: (2, 4, 4) T_world_cam of both; identity where not known.
    """

    group: PairGroup
    kind: str
    same_place: bool
    load: Callable[[int], Frame]
    poses: Transforms


@dataclass(frozen=True, slots=True, eq=False)
class ScoredPairs:
    """The pairs of one sequence or folder, and each detector's scores (M,) of them."""

    name: str
    pairs: Sequence[Pair]
    scores: Mapping[str, FloatArray]

    @property
    def same_place(self) -> BoolArray:
        """Truth (M,)."""
        return np.array([pair.same_place for pair in self.pairs], dtype=bool)


@dataclass(frozen=True, slots=True)
class GroupAccuracy:
    """Share of a group's pairs that were classified correctly, and their number."""

    accuracy: float
    pairs: int


@dataclass(frozen=True, slots=True)
class PairQuality:
    """A row of the table: a detector's accuracy in each group."""

    detector: str
    groups: dict[str, GroupAccuracy]


class ViewMaker(Protocol):
    """Makes what detectors see out of a frame: features, and labels where they are needed."""

    def __call__(self, identity: int, frame: Frame, T_world_cam: Transform) -> KeyframeView:
        """The view of keyframe ``identity``."""


def score_pairs(detectors: Mapping[str, Scorer], pairs: Sequence[Pair], make_view: ViewMaker) -> dict[str, FloatArray]:
    """Scores (M,) of each pair by each detector: the first frame is remembered, the second one asked for.

    Args:
        detectors: fresh ones, set to name every pair they can (as for ``semslam.eval.loops.precision_recall``). All
            first frames are in one database, their stamps far apart; a pair that is not named scores 0.
        pairs: what to score.
        make_view: is called twice a pair.
    """
    for index, view in enumerate(_views(pairs, 0, make_view)):
        for detector in detectors.values():
            detector.add(view)
        assert view.keyframe.id == index
    scores = {name: np.zeros(len(pairs)) for name in detectors}
    for index, view in enumerate(_views(pairs, 1, make_view)):
        for name, detector in detectors.items():
            scores[name][index] = max((c.score for c in detector.query(view) if c.match == index), default=0.0)
    return scores


def best_threshold(scores: FloatArray, same_place: BoolArray) -> float:
    """The score from which on "same place" is right most often: midway between the scores it parts.

    Same and different places weigh alike, however many there are of each; of equal thresholds the highest.
    """
    values = np.unique(scores)[::-1]
    cuts = np.concatenate([[values[0] + 1e-9], (values[:-1] + values[1:]) / 2, [values[-1]]])
    accepted = scores[None, :] >= cuts[:, None]
    hits = (accepted & same_place).sum(axis=1) / max(int(same_place.sum()), 1)
    alarms = (accepted & ~same_place).sum(axis=1) / max(int((~same_place).sum()), 1)
    return float(cuts[np.argmax(hits - alarms)])


def find_thresholds(
    tested: Sequence[ScoredPairs], tuning: Sequence[ScoredPairs] = (), own: Mapping[str, float] | None = None
) -> dict[str, list[float]]:
    """Each detector's threshold for each tested set, never chosen on that set.

    Args:
        tested: what will be judged.
        tuning: other sets that the threshold comes from; without them it comes from all the other tested sets.
        own: thresholds of detectors that bring one, as a probability does; they are taken as they are.

    Raises:
        ConfigError: there is no other set with pairs.
    """
    filled = [some for some in tuning or tested if some.pairs]
    if not filled or (not tuning and len(filled) < 2):
        raise ConfigError("The threshold comes from other sequences: give at least two that hold pairs.")
    thresholds: dict[str, list[float]] = {name: [] for name in tested[0].scores}
    for some in tested:
        others = [other for other in filled if other is not some]
        same = np.concatenate([other.same_place for other in others])
        for name, found in thresholds.items():
            scores = np.concatenate([other.scores[name] for other in others])
            found.append(own[name] if own and name in own else best_threshold(scores, same))
    return thresholds


def judge_pairs(tested: Sequence[ScoredPairs], thresholds: Mapping[str, Sequence[float]]) -> list[PairQuality]:
    """Accuracy of each detector in each group over all sets, each at its own threshold."""
    return [PairQuality(name, _accuracy(name, tested, cuts)) for name, cuts in thresholds.items()]


def _accuracy(name: str, tested: Sequence[ScoredPairs], thresholds: Sequence[float]) -> dict[str, GroupAccuracy]:
    right: dict[PairGroup, list[bool]] = {group: [] for group in PairGroup}
    for some, threshold in zip(tested, thresholds, strict=True):
        for pair, score in zip(some.pairs, some.scores[name], strict=True):
            right[pair.group].append(bool((score >= threshold) == pair.same_place))
    return {group.value: GroupAccuracy(float(np.mean(hits)), len(hits)) for group, hits in right.items() if hits}


def _views(pairs: Sequence[Pair], side: int, make_view: ViewMaker) -> Iterator[KeyframeView]:
    for index, pair in enumerate(pairs):
        identity = index + side * len(pairs)
        frame = replace(pair.load(side), index=identity, timestamp=APART * identity)
        yield make_view(identity, frame, pair.poses[side])
