"""Learns the fusion from views of photos: the projection of descriptors, and the weights of the parts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from semslam.loop.detectors.bag_of_words.word_index import Bag, WordIndex
from semslam.loop.detectors.common.cosine_index import WholeIndex
from semslam.loop.detectors.fused.class_index import ClassIndex
from semslam.loop.detectors.fused.fusion import ClassFeatures, FusionModel
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.types import Float32Array, FloatArray, IntArray

BoolArray = npt.NDArray[np.bool_]
DIMENSIONS = 256
RIDGE = 2.0
"""Share of the mean variance that is added to each direction: photos show only some of what changes."""
FOLDS = 4
USUAL_PRIOR = 20.0
"""Weight, in views full of one class, of the mean over all classes in the mean of each."""
NEGATIVES = 8
"""Pairs of different places for each pair of the same place."""
APART = 15
"""Photos that follow each other may show one room; pairs of different places are at least this many photos apart."""
ROUNDS = 3
"""How often each view's hard negative is chosen anew."""


@dataclass(frozen=True, slots=True, eq=False)
class DescribedViews:
    """Views of photos, with all that the detector's parts compute of them.

    Attributes:
        photo: (N,) number of the photo that each view shows a part of.
        pooled: (N, 832) pooled layers.
        bags: words of each view.
        classes: class features of each view.
    """

    photo: IntArray
    pooled: Float32Array
    bags: list[Bag]
    classes: list[ClassFeatures]


@dataclass(frozen=True, slots=True, eq=False)
class _Fold:
    """Views that the projection has not seen, as one detector's keyframes.

    Attributes:
        parts: (N, N, 3) scores of whole image, words and classes.
        same: (N, N) pairs of the same place, each once.
        negative: (N, N) pairs of different places, both ways.
    """

    parts: FloatArray
    same: BoolArray
    negative: BoolArray


def train_fusion(described: DescribedViews, same: IntArray, seed: int) -> FusionModel:
    """Learn the projection from pairs of views, then how to join the parts on views that it did not see.

    Args:
        described: the views.
        same: (M, 2) pairs of views that overlap well.
        seed: of the pairs of different places.
    """
    pairs, truth = _with_negatives(described.photo, same, seed)
    usual = learn_usual(described.classes)
    number = described.photo * FOLDS // (int(described.photo.max()) + 1)
    folds = []
    for held in range(FOLDS):
        unseen = (number[pairs] != held).all(axis=1)
        mean, projection = learn_projection(described.pooled, pairs[unseen], truth[unseen])
        descriptors = ((described.pooled - mean) @ projection).astype(np.float32)
        folds.append(_fold(described, descriptors, usual, np.flatnonzero(number == held), same))
    weights, bias = _join(folds, seed)
    mean, projection = learn_projection(described.pooled, pairs, truth)
    return FusionModel(mean, projection, usual, weights, bias)


def learn_usual(classes: Sequence[ClassFeatures]) -> Float32Array:
    """Mean features (41, C) of each NYUv2 class, by its share of the views; row 0, and rare ones, those of all."""
    shares = np.concatenate([features.shares for features in classes])
    labels = np.concatenate([features.labels for features in classes])
    weighed = np.concatenate([features.vectors for features in classes]) * shares[:, None]
    member = (labels[None, :] == np.arange(len(NYU40_NAMES))[:, None]).astype(np.float64)
    overall = weighed.sum(axis=0) / max(float(shares.sum()), 1e-9)
    usual = (member @ weighed + USUAL_PRIOR * overall) / (member @ shares + USUAL_PRIOR)[:, None]
    return np.asarray(usual, dtype=np.float32)


def learn_projection(pooled: Float32Array, pairs: IntArray, same: BoolArray) -> tuple[Float32Array, Float32Array]:
    """Mean (D,) and projection (D, 256) by learned whitening (Mikolajczyk and Matas, ICCV 2007).

    Args:
        pooled: (N, D) descriptors.
        pairs: (M, 2) of them.
        same: (M,) whether a pair shows the same place.
    """
    seen = np.unique(pairs)
    mean = pooled[seen].mean(axis=0)
    difference = (pooled[pairs[:, 0]] - pooled[pairs[:, 1]]).astype(np.float64)
    within = _scatter(difference[same])
    variances, axes = np.linalg.eigh(within + RIDGE * np.trace(within) / len(within) * np.eye(len(within)))
    whiten = axes / np.sqrt(variances)
    _, directions = np.linalg.eigh(_scatter(difference[~same] @ whiten))
    projection = whiten @ directions[:, ::-1][:, :DIMENSIONS]
    return mean.astype(np.float32), projection.astype(np.float32)


def _with_negatives(photo: IntArray, same: IntArray, seed: int) -> tuple[IntArray, BoolArray]:
    drawn = np.random.default_rng(seed).integers(0, len(photo), (2 * NEGATIVES * len(same), 2))
    negative = drawn[np.abs(photo[drawn[:, 0]] - photo[drawn[:, 1]]) > APART][: NEGATIVES * len(same)]
    truth = np.concatenate([np.ones(len(same), np.bool_), np.zeros(len(negative), np.bool_)])
    return np.concatenate([same, negative]), truth


def _scatter(differences: FloatArray) -> FloatArray:
    scatter: FloatArray = differences.T @ differences / max(len(differences), 1)
    return scatter


def _fold(
    described: DescribedViews, descriptors: Float32Array, usual: Float32Array, members: IntArray, same: IntArray
) -> _Fold:
    classes = [described.classes[i].against(usual) for i in members]
    whole_index, word_index = WholeIndex(descriptors.shape[1]), WordIndex()
    class_index = ClassIndex(usual.shape[1])
    for i, features in zip(members, classes, strict=True):
        whole_index.add(descriptors[i])
        word_index.add(described.bags[i])
        class_index.add(features)
    parts = np.empty((len(members), len(members), 3))
    for row, (i, features) in enumerate(zip(members, classes, strict=True)):
        parts[row, :, 0] = whole_index.scores(descriptors[i])
        parts[row, :, 1] = np.sqrt(word_index.scores(described.bags[i]))
        parts[row, :, 2] = class_index.scores(features)
    places = np.full(len(described.photo), -1)
    places[members] = np.arange(len(members))
    first, second = places[same[(places[same] >= 0).all(axis=1)]].T
    together = np.zeros(parts.shape[:2], dtype=np.bool_)
    together[first, second] = True
    photo = described.photo[members]
    return _Fold(parts, together, np.abs(photo[:, None] - photo) > APART)


def _join(folds: Sequence[_Fold], seed: int) -> tuple[FloatArray, float]:
    """Weights (3,) and bias of the logistic score.

    The direction is learned with each view's hard negative among the pairs: what must be separated are places that
    look alike. Slope and offset of the function come from pairs drawn at random, so that it is a calibrated
    probability.
    """
    rng = np.random.default_rng(seed)
    same = np.concatenate([fold.parts[fold.same] for fold in folds])
    negative = np.concatenate([_drawn(fold, rng) for fold in folds])
    weights, _ = _logistic(same, negative)
    for _ in range(ROUNDS):
        hardest = np.concatenate([_hardest(fold, weights) for fold in folds])
        weights, _ = _logistic(same, np.concatenate([negative, hardest]))
    scale, bias = _logistic((same @ weights)[:, None], (negative @ weights)[:, None])
    return weights * scale, bias


def _drawn(fold: _Fold, rng: np.random.Generator) -> FloatArray:
    rows, columns = np.nonzero(np.triu(fold.negative))
    chosen = rng.choice(len(rows), min(NEGATIVES * int(fold.same.sum()), len(rows)), replace=False)
    return fold.parts[rows[chosen], columns[chosen]]


def _hardest(fold: _Fold, weights: FloatArray) -> FloatArray:
    nearest = np.where(fold.negative, fold.parts @ weights, -np.inf).argmax(axis=1)
    hardest: FloatArray = fold.parts[np.arange(len(nearest)), nearest]
    return hardest


def _logistic(same: FloatArray, negative: FloatArray) -> tuple[FloatArray, float]:
    """Weights (D,) and bias of a logistic regression on standardised values."""
    from sklearn.linear_model import LogisticRegression
    from sklearn.preprocessing import StandardScaler

    features = np.concatenate([same, negative])
    scaler = StandardScaler().fit(features)
    truth = np.arange(len(features)) < len(same)
    model = LogisticRegression(C=1.0).fit(scaler.transform(features), truth)
    weights: FloatArray = model.coef_[0] / scaler.scale_
    return weights, float(model.intercept_[0] - weights @ scaler.mean_)
