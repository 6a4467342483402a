"""Loops between object submaps: places known again from another side, in other light, after things were moved."""

from collections import deque
from collections.abc import Collection
from typing import Self

import numpy as np

from semslam.config import Config, LoopConfig
from semslam.errors import ConfigError
from semslam.geometry.se3 import invert, transform_points
from semslam.loop.detector import Arrays
from semslam.loop.detectors.common.backbone import MIDDLE_CHANNELS, Backbone
from semslam.loop.detectors.common.growing import GrowingArray
from semslam.loop.detectors.common.memo import LastView
from semslam.loop.detectors.common.remembering import RememberingDetector
from semslam.loop.detectors.objects.labelled import GROUP_COUNT, GROUP_LIST, LabelledCloud, label_cloud
from semslam.loop.detectors.objects.matching import SubmapMatch, match_submaps
from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.loop.detectors.objects.submap import Submap, build_submap
from semslam.types import (
    Float32Array,
    FloatArray,
    Keyframe,
    KeyframeView,
    LoopCandidate,
    LoopEvidence,
    ObjectPair,
    SubmapGuess,
)

LOOK_DIMENSIONS = 24
"""How many random directions of the encoder's middle features are kept."""


class ObjectsDetector(RememberingDetector[Submap]):
    """Submaps of objects and walls, matched by class, look and place.

    The clouds of the keyframes of the last few metres are laid together in odometry's frame, their classes are counted
    in voxels, and connected voxels of one group of classes become objects; vertical planes become walls. Up is known
    from the floor, so two submaps differ by a turn and a shift. Earlier submaps that hold alike amounts of each group
    are matched object by object and wall by wall; the share that agrees on one pose is the score, and the pose is the
    candidate's guess, from which the verification registers both submaps' clouds.
    """

    name = "objects"
    needs_labels = True
    Settings = ObjectsConfig

    def __init__(self, backbone: Backbone, config: ObjectsConfig, loops: LoopConfig) -> None:
        super().__init__(loops, config.min_score)
        self._backbone, self._config = backbone, config
        self._recent: deque[LabelledCloud] = deque()
        rng = np.random.default_rng(0)
        self._directions = np.linalg.qr(rng.normal(size=(MIDDLE_CHANNELS, LOOK_DIMENSIONS)))[0].astype(np.float32)
        self._cloud = LastView(self._label)
        self._clear()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``objects``, ``loops`` and ``segmentation`` (for the network).

        Raises:
            ModelError: weights are missing or damaged.
        """
        return cls(Backbone.from_config(config, deep=False), config.section(cls.name, cls.Settings), config.loops)

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates by the share of objects and walls that agree, with the pose they agree on.

        Raises:
            ConfigError: the view holds no labels.
        """
        if not len(self._timeline):
            return []
        submap = self._look(view)
        least = self._timeline.min_score
        shortlist = self._shortlist(view, submap)
        found = match_submaps(submap, [self._looks[at] for at in shortlist], self._config, least)
        matches = dict(zip(shortlist, found, strict=True))
        scores = np.zeros(len(self._timeline))
        for at, match in matches.items():
            scores[at] = 0.0 if match is None else match.score
        candidates = []
        for at in self._timeline.best(view.keyframe, scores):
            match = matches[at]
            assert match is not None
            if len(match.objects) >= self._config.min_objects:
                candidates.append(self._candidate(view, submap, at, match))
        least_views = self._config.min_keyframes
        return [c for c in candidates if c.guess and min(len(c.guess.query), len(c.guess.match)) >= least_views]

    def add(self, view: KeyframeView) -> None:
        """Remember the view's submap, and its cloud for the submaps of the next keyframes."""
        super().add(view)
        cloud = self._cloud(view)
        self._recent = deque([*self._window(view.keyframe, cloud.travelled), cloud])

    def forget(self, ids: Collection[int]) -> None:
        """See ``Remembering``; submaps that a forgotten keyframe has become part of keep what it saw."""
        super().forget(ids)
        self._recent = deque(cloud for cloud in self._recent if cloud.keyframe.id not in ids)

    def _clear(self) -> None:
        self._contents = GrowingArray(np.float32, (3 * GROUP_COUNT,))

    def _enter(self, look: Submap) -> None:
        self._contents.append(look.content[None])

    def _to_arrays(self, look: Submap) -> Arrays:
        return look.to_arrays()

    def _from_arrays(self, arrays: Arrays) -> Submap:
        return Submap.from_arrays(arrays)

    def _describe(self, view: KeyframeView) -> Submap:
        cloud = self._cloud(view)
        return build_submap([*self._window(view.keyframe, cloud.travelled), cloud], self._config)

    def _label(self, view: KeyframeView) -> LabelledCloud:
        if view.labels is None:
            raise ConfigError(f"The detector '{self.name}' needs a segmentation, and none came with the keyframe.")
        travelled = 0.0
        if self._recent:
            last = self._recent[-1]
            step = view.keyframe.T_odom_cam[:3, 3] - last.keyframe.T_odom_cam[:3, 3]
            travelled = last.travelled + float(np.linalg.norm(step))
        middle = self._backbone.middle(view)
        looks: Float32Array = middle.reshape(-1, MIDDLE_CHANNELS) @ self._directions
        return label_cloud(view, looks, middle.shape[:2], self._config.max_depth, travelled)

    def _window(self, keyframe: Keyframe, travelled: float) -> list[LabelledCloud]:
        """Recent clouds that belong to the submap of a new keyframe."""
        config = self._config
        return [
            cloud
            for cloud in list(self._recent)[-(config.max_keyframes - 1) :]
            if cloud.keyframe.map_id == keyframe.map_id
            and travelled - cloud.travelled <= config.reach
            and keyframe.timestamp - cloud.keyframe.timestamp <= config.max_age
        ]

    def _shortlist(self, view: KeyframeView, submap: Submap) -> list[int]:
        """Positions of submaps that ended ``loops.min_gap`` before this one begins and hold the same things.

        What both hold of each group at each height, as a share of what the poorer one holds; groups that few submaps
        hold weigh more (inverse document frequency).
        """
        contents = self._contents.rows
        rarity = np.log((1 + len(contents)) / (1 + (contents > 0).sum(axis=0)))
        common = np.minimum(contents, submap.content) @ rarity
        alike = common / np.maximum(np.minimum(contents @ rarity, submap.content @ rarity), 1e-9)
        stamps = self._timeline.stamps
        old = submap.start - stamps >= self._loops.min_gap
        chosen: list[int] = []
        for at in np.argsort(-np.where(old, alike, -1.0), kind="stable").tolist():
            if not old[at] or len(chosen) == self._config.shortlist:
                break
            if all(abs(stamps[at] - stamps[other]) >= self._config.spacing for other in chosen):
                chosen.append(at)
        return chosen

    def _members(self, submap: Submap, newest: float) -> tuple[int, ...]:
        """Ids of the remembered keyframes of a submap whose newest one has this time stamp."""
        stamps = self._timeline.stamps
        inside = np.flatnonzero((stamps >= submap.start) & (stamps <= newest))
        return tuple(self._timeline.id_at(int(at)) for at in inside)

    def _candidate(self, view: KeyframeView, query: Submap, at: int, found: SubmapMatch) -> LoopCandidate:
        match, anchor = self._looks[at], view.keyframe.id
        T = match.T_cam_level @ found.T_match_query @ invert(query.T_cam_level)
        ours = tuple(i for i in self._members(query, view.keyframe.timestamp) if i != anchor)
        theirs = self._members(match, float(self._timeline.stamps[at]))
        guess = SubmapGuess(tuple(map(tuple, T.tolist())), (*ours, anchor), theirs)
        i, j = found.objects.T
        names = [_group_name(group) for group in query.objects.groups[i].tolist()]
        places = _places(query.T_cam_level, query.objects.centroids[i])
        objects = tuple(map(ObjectPair, names, places, _places(match.T_cam_level, match.objects.centroids[j])))
        figures = {
            "matched_objects": float(len(found.objects)),
            "matched_walls": float(len(found.walls)),
            "rival": found.rival,
        }
        labels = tuple(sorted({pair.label for pair in objects}))
        evidence = LoopEvidence(labels, figures=figures, objects=objects)
        return LoopCandidate(anchor, self._timeline.id_at(at), found.score, self.name, evidence, guess)


def _group_name(group: int) -> str:
    return GROUP_LIST[group] if group < len(GROUP_LIST) else f"class {group}"


def _places(T_cam_level: FloatArray, centroids: Float32Array) -> list[tuple[float, float, float]]:
    return [(x, y, z) for x, y, z in transform_points(T_cam_level, centroids.astype(np.float64)).tolist()]
