"""Semantics together with the rest of the image: the question that the paper leaves open in its section 5."""

from dataclasses import dataclass
from typing import Any, Self

import cv2
import numpy as np
import numpy.typing as npt

from semslam.config import Config, LoopConfig
from semslam.loop.detector import Arrays
from semslam.loop.detectors.bag_of_words.detector import make_bag
from semslam.loop.detectors.bag_of_words.vocabulary import Vocabulary, load_vocabulary
from semslam.loop.detectors.bag_of_words.word_index import Bag, WordIndex, bag_of_arrays, bag_to_arrays
from semslam.loop.detectors.common.backbone import MIDDLE_CHANNELS, Backbone
from semslam.loop.detectors.common.cosine_index import WholeIndex
from semslam.loop.detectors.common.labels import labels_of
from semslam.loop.detectors.common.remembering import RememberingDetector
from semslam.loop.detectors.fused.class_index import ClassIndex
from semslam.loop.detectors.fused.fusion import ENCODED_SIZE, ClassFeatures, FusionModel, load_fusion, pool_classes
from semslam.loop.detectors.fused.settings import FusedConfig
from semslam.loop.detectors.fused.upright import roll_of, turn_image, turn_labels
from semslam.loop.segmentation.classes import MOVABLE
from semslam.loop.segmentation.decoding import shrink
from semslam.types import Float32Array, FloatArray, KeyframeView, LoopCandidate, LoopEvidence


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """What is kept of a view."""

    whole: Float32Array
    bag: Bag
    classes: ClassFeatures


class FusedDetector(RememberingDetector[_Look]):
    """Features of the whole image, its words, and features of each class in it, joined to a probability.

    - whole: two layers of the encoder, pooled to one vector by a generalised mean of their positive and negative
      parts and projected so that what changes with viewpoint and light is suppressed; cosine;
    - words: square root of the L1 score of tf-idf bags of ORB words;
    - classes: the encoder's mid-level features averaged over each segmented class, as they differ from the class's
      mean features in photos, compared class by class and weighed by the class's share of the image; classes that
      people move count less than structure.

    Images are turned upright by the tracked roll first. Cosines are taken without half of what the keyframes so far
    have in common. A logistic function, learned on warped and relit photos of other places, joins the three. Some of
    the candidates are the best by words alone: their probability is rarely the highest, but their pose can often be
    verified.
    """

    name = "fused"
    needs_labels = True
    Settings = FusedConfig

    def __init__(
        self, backbone: Backbone, vocabulary: Vocabulary, model: FusionModel, config: FusedConfig, loops: LoopConfig
    ) -> None:
        super().__init__(loops, config.min_probability)
        self._backbone, self._vocabulary, self._model, self._config = backbone, vocabulary, model, config
        self._max_candidates = loops.max_candidates
        self._clear()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``fused``, ``loops`` and ``segmentation`` (for the network).

        Raises:
            ModelError: weights are missing or damaged.
        """
        backbone = Backbone.from_config(config, size=ENCODED_SIZE)
        own = config.section(cls.name, cls.Settings)
        return cls(backbone, load_vocabulary(), load_fusion(), own, config.loops)

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates by probability, with the share of each part and the labels in common.

        Raises:
            ConfigError: the view holds no labels.
        """
        if not len(self._timeline):
            return []
        parts = self._parts(self._look(view))
        probability = self._model.probability(parts)
        chosen = self._choose(view, probability, parts[:, 1])
        return [self._candidate(view, at, float(probability[at]), parts[at]) for at in chosen]

    def _clear(self) -> None:
        self._whole = WholeIndex(self._model.projection.shape[1])
        self._words = WordIndex()
        self._classes = ClassIndex(MIDDLE_CHANNELS)

    def _enter(self, look: _Look) -> None:
        self._whole.add(look.whole)
        self._words.add(look.bag)
        self._classes.add(look.classes)

    def _to_arrays(self, look: _Look) -> Arrays:
        classes = look.classes
        arrays: dict[str, npt.NDArray[Any]] = {"whole": look.whole, **bag_to_arrays(look.bag)}
        return arrays | {"labels": classes.labels, "vectors": classes.vectors, "shares": classes.shares}

    def _from_arrays(self, arrays: Arrays) -> _Look:
        labels = np.asarray(arrays["labels"], np.uint8)
        vectors, shares = np.asarray(arrays["vectors"], np.float32), np.asarray(arrays["shares"], np.float64)
        if vectors.shape != (len(labels), MIDDLE_CHANNELS) or shares.shape != labels.shape:
            raise ValueError("no class features")
        whole = np.asarray(arrays["whole"], np.float32)
        return _Look(whole, bag_of_arrays(arrays), ClassFeatures(labels, vectors, shares))

    def _describe(self, view: KeyframeView) -> _Look:
        segmented = labels_of(view, self.name)
        roll, size = roll_of(view.keyframe.T_odom_cam), self._backbone.size
        encoding = self._backbone.encode(turn_image(shrink(view.color, size), roll))
        labels = turn_labels(cv2.resize(segmented.labels, size, interpolation=cv2.INTER_NEAREST), roll)  # type: ignore[arg-type]
        movable = frozenset(i for i, name in enumerate(segmented.names) if name in MOVABLE)
        usual = self._model.usual_features(segmented.names)
        classes = pool_classes(encoding.middle, labels, movable).against(usual)
        bag = make_bag(self._vocabulary, view.keyframe.features.descriptors)
        return _Look(self._model.whole(encoding), bag, classes)

    def _parts(self, look: _Look) -> FloatArray:
        """Scores (N, 3) of whole image, words and classes with each remembered keyframe."""
        words = np.sqrt(self._words.scores(look.bag))
        return np.column_stack([self._whole.scores(look.whole), words, self._classes.scores(look.classes)])

    def _choose(self, view: KeyframeView, probability: FloatArray, words: FloatArray) -> list[int]:
        """Positions by falling probability; a share of them are the best by words."""
        likely = self._timeline.best(view.keyframe, probability)
        spare = min(int(self._config.word_share * self._max_candidates), self._max_candidates - 1)
        kept = likely[: self._max_candidates - spare]
        plausible = np.where(probability >= self._config.min_word_probability, words, 0.0)
        by_words = [at for at in self._timeline.nearest(view.keyframe, plausible) if at not in kept]
        rest = [at for at in likely if at not in kept and at not in by_words[:spare]]
        chosen = kept + (by_words[:spare] + rest)[: self._max_candidates - len(kept)]
        return sorted(chosen, key=lambda at: (-probability[at], at))

    def _candidate(self, view: KeyframeView, at: int, probability: float, parts: FloatArray) -> LoopCandidate:
        assert view.labels is not None
        common = np.intersect1d(self._look(view).classes.labels, self._looks[at].classes.labels)
        labels = tuple(view.labels.names[label] for label in common)
        figures = {"whole": float(parts[0]), "words": float(parts[1]), "classes": float(parts[2])}
        evidence = LoopEvidence(labels, figures=figures)
        return LoopCandidate(view.keyframe.id, self._timeline.id_at(at), probability, self.name, evidence)
