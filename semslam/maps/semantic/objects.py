"""Object instances: points of one class that lie together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from semslam.types import Float32Array, FloatArray, IntArray, UInt8Array

STRUCTURE = frozenset({"void", "wall", "floor", "ceiling", "otherstructure"})
"""Classes that are no objects."""
REACH = 2.5
"""Voxels; points of a class within this distance belong to one object."""
DENSE = 5
"""Points within reach that make a point part of an object's inside (DBSCAN's min_samples)."""
MIN_AREA = 0.04
"""Square metres of surface; less is no object."""
SEEN_SHARE = 0.1
"""Share of an object's points that a keyframe must show to have seen it."""


@dataclass(frozen=True, slots=True, eq=False)
class MapObject:
    """An object in the map.

    Attributes:
        id: 0, 1, 2... from the largest to the smallest.
        name: its class.
        confidence: mean over its points, 0..1.
        centroid: (3,) metres, in the world.
        extent: (3,) metres along ``axes``, the longest first.
        axes: (3, 3) the principal axes of its points, as columns, in the world.
        rows: (N,) its points in the map.
        keyframes: ids of those that saw it.
    """

    id: int
    name: str
    confidence: float
    centroid: FloatArray
    extent: FloatArray
    axes: FloatArray
    rows: IntArray
    keyframes: tuple[int, ...]


def find_objects(
    points: Float32Array,
    labels: UInt8Array,
    confidence: Float32Array,
    names: Sequence[str],
    views: Mapping[int, IntArray],
    voxel: float,
) -> tuple[MapObject, ...]:
    """Find the objects of a labelled map, the largest first.

    Args:
        points: (N, 3) metres, one for each voxel.
        labels: (N,) indices into ``names``.
        confidence: (N,) of the labels.
        names: class names.
        views: rows of the points that each keyframe saw.
        voxel: the voxels' side in metres.
    """
    least = MIN_AREA / voxel**2
    clusters = [
        (label, rows)
        for label, name in enumerate(names)
        if name not in STRUCTURE
        for rows in _clusters(points, np.flatnonzero(labels == label), voxel)
        if len(rows) >= least
    ]
    clusters.sort(key=lambda cluster: (-len(cluster[1]), int(cluster[1][0])))
    owner = np.full(len(points), -1)
    for id, (_, rows) in enumerate(clusters):
        owner[rows] = id
    saw = _keyframes(owner, [len(rows) for _, rows in clusters], views)
    return tuple(
        MapObject(id, names[label], float(confidence[rows].mean()), *box(points[rows]), rows, saw[id])
        for id, (label, rows) in enumerate(clusters)
    )


def box(points: Float32Array) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The centroid (3,) of points (N, 3), their extents (3,) along their principal axes, and these axes (3, 3)."""
    centroid = points.mean(axis=0, dtype=np.float64)
    centred = points - centroid
    _, _, rows = np.linalg.svd(centred.T @ centred)
    # Each axis has two directions; the one whose largest component is positive is taken.
    signs = np.sign(rows[np.arange(3), np.abs(rows).argmax(axis=1)])
    axes = (rows * signs[:, None]).T
    extent = np.ptp(centred @ axes, axis=0)
    order = np.argsort(-extent, kind="stable")
    return centroid, extent[order], axes[:, order]


def _clusters(points: Float32Array, rows: IntArray, voxel: float) -> list[IntArray]:
    """Rows of the points that lie together; lone ones are left out."""
    if len(rows) < DENSE:
        return []
    from sklearn.cluster import DBSCAN

    groups = DBSCAN(eps=REACH * voxel, min_samples=DENSE).fit_predict(points[rows])
    return [rows[groups == group] for group in range(groups.max() + 1)]


def _keyframes(owner: IntArray, sizes: Sequence[int], views: Mapping[int, IntArray]) -> list[tuple[int, ...]]:
    """For each object the keyframes that saw enough of it."""
    saw: list[list[int]] = [[] for _ in sizes]
    for keyframe, rows in sorted(views.items()):
        inside = owner[rows]
        counts = np.bincount(inside[inside >= 0], minlength=len(sizes))
        for id in np.flatnonzero(counts >= SEEN_SHARE * np.maximum(sizes, 1)):
            saw[id].append(keyframe)
    return [tuple(keyframes) for keyframes in saw]
