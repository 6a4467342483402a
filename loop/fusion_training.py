"""Learns the fusion from views of photos: which directions of a descriptor to trust, and how to join the parts."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from loop.class_index import ClassIndex
from loop.fusion import ClassFeatures, FusionModel
from loop.word_index import Bag, WordIndex
from semslam.types import Float32Array, FloatArray, IntArray

DIMENSIONS = 256
RIDGE = 2.0
"""Share of the mean variance that is added to each direction: photos show only some of what changes."""
FOLDS = 4
STRANGERS = 8
"""Pairs of different places for each pair of the same place."""
APART = 15
"""Photos that follow each other may show one room; pairs of different places are at least this many photos apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Looks:
    """Views of photos, described.

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


def train_fusion(looks: Looks, same: IntArray, seed: int) -> FusionModel:
    """Learn the projection from pairs of views, then the logistic weights on projections that did not see them.

    Args:
        looks: the views.
        same: (M, 2) pairs of views that overlap well.
        seed: of the pairs of different places.
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.preprocessing import StandardScaler

    pairs, truth = _with_strangers(looks.photo, same, seed)
    fold = looks.photo * FOLDS // (int(looks.photo.max()) + 1)
    inside = fold[pairs[:, 0]] == fold[pairs[:, 1]]
    pairs_tested, truth_tested = pairs[inside], truth[inside]
    whole = np.zeros(len(pairs_tested))
    for held in range(FOLDS):
        unseen = (fold[pairs] != held).all(axis=1)
        mean, projection = learn_projection(looks.pooled, pairs[unseen], truth[unseen])
        tested = fold[pairs_tested[:, 0]] == held
        whole[tested] = _cosines(looks.pooled, mean, projection, pairs_tested[tested])
    parts = np.column_stack([whole, *_word_and_class_scores(looks, pairs_tested)])
    scaler = StandardScaler().fit(parts)
    logistic = LogisticRegression(C=1.0).fit(scaler.transform(parts), truth_tested)
    weights = logistic.coef_[0] / scaler.scale_
    mean, projection = learn_projection(looks.pooled, pairs, truth)
    return FusionModel(mean, projection, weights, float(logistic.intercept_[0] - weights @ scaler.mean_))


def learn_projection(
    pooled: Float32Array, pairs: IntArray, same: npt.NDArray[np.bool_]
) -> tuple[Float32Array, Float32Array]:
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


def _with_strangers(photo: IntArray, same: IntArray, seed: int) -> tuple[IntArray, npt.NDArray[np.bool_]]:
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, len(photo), (8 * STRANGERS * len(same), 2))
    strange = drawn[np.abs(photo[drawn[:, 0]] - photo[drawn[:, 1]]) > APART]
    # Half of the strangers come from near in the list, so that folds, which go by the list, hold enough of them.
    near = np.abs(photo[strange[:, 0]] - photo[strange[:, 1]]) < (int(photo.max()) + 1) // FOLDS
    half = STRANGERS * len(same) // 2
    strange = np.concatenate([strange[near][:half], strange[~near][:half]])
    truth = np.concatenate([np.ones(len(same), np.bool_), np.zeros(len(strange), np.bool_)])
    return np.concatenate([same, strange]), truth


def _scatter(differences: FloatArray) -> FloatArray:
    scatter: FloatArray = differences.T @ differences / max(len(differences), 1)
    return scatter


def _cosines(pooled: Float32Array, mean: Float32Array, projection: Float32Array, pairs: IntArray) -> FloatArray:
    projected = (pooled - mean) @ projection
    projected /= np.maximum(np.linalg.norm(projected, axis=1, keepdims=True), 1e-9)
    cosines: Float32Array = np.einsum("nd,nd->n", projected[pairs[:, 0]], projected[pairs[:, 1]])
    return cosines.astype(np.float64)


def _word_and_class_scores(looks: Looks, pairs: IntArray) -> tuple[FloatArray, FloatArray]:
    index, classes = WordIndex(), ClassIndex(looks.classes[0].vectors.shape[1])
    for bag, features in zip(looks.bags, looks.classes, strict=True):
        index.add(bag)
        classes.add(features)
    words, alike = np.zeros(len(pairs)), np.zeros(len(pairs))
    for first in np.unique(pairs[:, 0]):
        rows = np.flatnonzero(pairs[:, 0] == first)
        words[rows] = np.sqrt(index.scores(looks.bags[first])[pairs[rows, 1]])
        alike[rows] = classes.scores(looks.classes[first])[pairs[rows, 1]]
    return words, alike
