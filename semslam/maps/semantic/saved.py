"""A semantic map that was written, read again to be shown."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semslam.errors import ResultsError
from semslam.maps.semantic.semantic_map import JSON, PLY
from semslam.types import Float32Array, FloatArray, UInt8Array


@dataclass(frozen=True, slots=True, eq=False)
class ObjectBox:
    """The box around an object's points.

    Attributes:
        name: its class.
        label: the class's index.
        confidence: mean over its points, 0..1.
        centre: (3,) metres, in the world.
        half: (3,) half of its extents along ``axes``, metres.
        axes: (3, 3) a rotation, axes as columns in the world.
    """

    name: str
    label: int
    confidence: float
    centre: FloatArray
    half: FloatArray
    axes: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LabelledMap:
    """Points (N, 3) in the world with their labels (N,), indices into ``names``, and the objects."""

    points: Float32Array
    labels: UInt8Array
    names: tuple[str, ...]
    objects: tuple[ObjectBox, ...]


def read_semantic_map(directory: Path) -> LabelledMap:
    """Read ``semantic.ply`` and ``objects.json`` of a folder.

    Raises:
        ResultsError: a file is missing or was written by another version.
    """
    import open3d as o3d

    try:
        content = json.loads((directory / JSON).read_text(encoding="utf-8"))
        values = o3d.t.io.read_point_cloud(directory / PLY).point
        points, labels, owners = (values[name].numpy() for name in ("positions", "label", "object"))
        names = tuple(content["classes"])
        objects = tuple(
            _box(thing, names.index(thing["class"]), points[owners.ravel() == thing["id"]])
            for thing in content["objects"]
        )
    except (OSError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise ResultsError(f"The semantic map in {directory} cannot be read.") from error
    return LabelledMap(points, labels.ravel(), names, objects)


def _box(thing: dict[str, object], label: int, points: Float32Array) -> ObjectBox:
    centroid, axes = np.asarray(thing["centroid_m"], float), np.asarray(thing["axes"], float)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    inside = (points - centroid) @ axes
    low, high = inside.min(axis=0), inside.max(axis=0)
    confidence = float(str(thing["confidence"]))
    return ObjectBox(
        str(thing["class"]), label, confidence, centroid + axes @ ((low + high) / 2), (high - low) / 2, axes
    )
