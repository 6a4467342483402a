"""The semantic map, built, written and read."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from semslam.errors import ResultsError
from semslam.geometry.voxels import VoxelTable
from semslam.loop.segmentation.classes import PALETTE
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.maps.cloud import SurfaceFusion
from semslam.maps.ply import write_cloud
from semslam.maps.semantic.fusion import LabelFusion
from semslam.maps.semantic.objects import MapObject, find_objects
from semslam.maps.semantic.smoothing import smooth
from semslam.maps.views import PosedView, sample
from semslam.types import Cloud, Float32Array, IntArray, UInt8Array

VOXEL = 0.04
"""Metres."""
PLY, JSON = "semantic.ply", "objects.json"


@dataclass(frozen=True, slots=True, eq=False)
class SemanticMap:
    """A map whose points have labels.

    Attributes:
        cloud: one point for each voxel, in the world.
        keys: (N,) the voxels' numbers (``semslam.geometry.voxels``).
        voxel: their side in metres.
        labels: (N,) uint8 indices into ``names``; 0 is void.
        confidence: (N,) float32, how sure the label is, 0..1.
        names: class names.
        objects: the largest first.
        views: rows of the points that each keyframe saw.
    """

    cloud: Cloud
    keys: IntArray
    voxel: float
    labels: UInt8Array
    confidence: Float32Array
    names: tuple[str, ...]
    objects: tuple[MapObject, ...]
    views: dict[int, IntArray]

    @property
    def owners(self) -> IntArray:
        """The id (N,) of the object that each point belongs to, or -1."""
        owners = np.full(len(self.cloud), -1, dtype=np.int64)
        for thing in self.objects:
            owners[thing.rows] = thing.id
        return owners

    @property
    def palette(self) -> UInt8Array:
        """An RGB colour (C, 3) for each class."""
        return PALETTE[np.arange(len(self.names)) % len(PALETTE)]


def build_semantic_map(views: Iterable[PosedView], segmenter: Segmenter, voxel: float = VOXEL) -> SemanticMap:
    """Label every view and fuse the labels.

    Args:
        views: the keyframes of one map.
        segmenter: labels their images.
        voxel: metres; the map has one point in each cell.
    """
    voxels = VoxelTable(voxel)
    surface, labels = SurfaceFusion(voxels), LabelFusion(voxels, segmenter.names)
    for view in views:
        samples = sample(view)
        surface.add(view, samples)
        found = segmenter.segment(view.frame.color, view.frame.depth, view.frame.source_index)
        labels.add(view.keyframe, samples, found)
    cloud = surface.cloud()
    beliefs = smooth(labels.votes, cloud, voxel)
    heard = labels.votes.any(axis=1)
    winners = np.where(heard, beliefs.argmax(axis=1), 0).astype(np.uint8)
    confidence = np.where(heard, beliefs.max(axis=1), 0).astype(np.float32)
    objects = find_objects(cloud.points, winners, confidence, labels.names, labels.views, voxel)
    return SemanticMap(cloud, voxels.keys, voxel, winners, confidence, labels.names, objects, labels.views)


def write_semantic_map(directory: Path, built: SemanticMap) -> list[Path]:
    """Write ``semantic.ply`` and ``objects.json``.

    The points of the PLY are coloured by class and hold ``label``, ``confidence`` and ``object`` (-1 for none).

    Returns:
        The files written.

    Raises:
        ResultsError: a file cannot be written.
    """
    painted = Cloud(built.cloud.points, built.cloud.normals, built.palette[built.labels])
    columns: dict[str, npt.NDArray[Any]] = {
        "label": built.labels,
        "confidence": built.confidence,
        "object": built.owners.astype(np.int32),
    }
    write_cloud(directory / PLY, painted, columns)
    content = {
        "voxel_m": built.voxel,
        "classes": list(built.names),
        "objects": [_plain(thing) for thing in built.objects],
    }
    try:
        (directory / JSON).write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise ResultsError(f"{directory / JSON} cannot be written: {error.strerror or error}.") from error
    return [directory / PLY, directory / JSON]


def _plain(thing: MapObject) -> dict[str, object]:
    return {
        "id": thing.id,
        "class": thing.name,
        "confidence": round(thing.confidence, 4),
        "points": len(thing.rows),
        "centroid_m": np.round(thing.centroid, 4).tolist(),
        "extent_m": np.round(thing.extent, 4).tolist(),
        "axes": np.round(thing.axes, 6).tolist(),
        "keyframes": list(thing.keyframes),
    }
