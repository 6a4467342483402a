"""Labels of neighbouring points made to agree where the surface looks alike."""

import numpy as np

from semslam.types import Cloud, Float32Array

NEIGHBOURS = 16
COLOR_SIGMA, NORMAL_SIGMA, DISTANCE_SIGMA = 0.1, 0.3, 2.0
"""How unlike neighbours may be: colour in 0..1, 1 - cosine of the normals, distance in voxels."""
STRENGTH = 2.0
"""What a neighbour that is quite alike and sure adds to the logarithm of its class's odds."""
ROUNDS = 10
SHARPNESS = 0.3
"""Power to which the beliefs are raised in the end: neighbours that agree are counted as if each knew it by itself.

With it the mean probability of the chosen labels is the share that is right, on the rendered house (seed 0).
"""


def smooth(votes: Float32Array, cloud: Cloud, voxel: float) -> Float32Array:
    """Probabilities of the classes after neighbours were heard: mean field inference in a conditional random field.

    The pairwise terms are Potts', weighted by bilateral Gaussians of place, colour and normal as in Kraehenbuehl and
    Koltun, NIPS 2011, between each point and its nearest neighbours. The constants are those with the best mIoU of
    map points on the rendered house (seed 0).

    Args:
        votes: (N, C) logarithms of the classes' odds.
        cloud: the points, with normals and colours.
        voxel: metres between neighbouring points.

    Returns:
        (N, C) float32 probabilities.
    """
    used = np.flatnonzero(votes.any(axis=0))
    if len(cloud) <= NEIGHBOURS or not len(used):
        return _softmax(votes)
    from scipy.sparse import csr_matrix
    from sklearn.neighbors import NearestNeighbors

    distances, neighbours = NearestNeighbors(n_neighbors=NEIGHBOURS + 1).fit(cloud.points).kneighbors(cloud.points)
    weights = _likeness(cloud, neighbours[:, 1:], distances[:, 1:] / voxel)
    starts = np.arange(0, weights.size + 1, NEIGHBOURS)
    graph = csr_matrix((weights.ravel(), neighbours[:, 1:].ravel(), starts), shape=(len(cloud), len(cloud)))
    unary = votes[:, used]
    beliefs = _softmax(unary)
    for _ in range(ROUNDS):
        logits = unary + STRENGTH * (graph @ beliefs)
        beliefs = _softmax(logits)
    whole = np.zeros_like(votes)
    whole[:, used] = _softmax(SHARPNESS * logits)
    return whole


def _likeness(cloud: Cloud, neighbours: np.ndarray, distances: np.ndarray) -> Float32Array:
    """How alike each point (N, K) and its neighbours are, 0..1."""
    exponent = (distances / DISTANCE_SIGMA) ** 2
    exponent += ((1.0 - np.einsum("nc,nkc->nk", cloud.normals, cloud.normals[neighbours])) / NORMAL_SIGMA) ** 2
    if cloud.colors is not None:
        colors = cloud.colors.astype(np.float32) / 255.0
        exponent += ((colors[neighbours] - colors[:, None]) ** 2).sum(axis=2) / COLOR_SIGMA**2
    return np.exp(-0.5 * exponent).astype(np.float32)


def _softmax(logits: Float32Array) -> Float32Array:
    grown = np.exp(logits - logits.max(axis=1, keepdims=True))
    return np.asarray(grown / grown.sum(axis=1, keepdims=True), dtype=np.float32)
