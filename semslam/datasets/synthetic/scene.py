"""A scene: triangles with materials and labels, and the lights in it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from semslam.datasets.synthetic.atlas import Material
from semslam.datasets.synthetic.shapes import Part
from semslam.geometry.se3 import FloatArray


@dataclass(frozen=True, slots=True)
class Light:
    """A small source of light.

    Attributes:
        position: (3,) metres.
        color: (3,) linear RGB intensity.
        normal: (3,) where it shines by the cosine law, or None for all around.
        lamp: "day" (windows) or "lamps".
    """

    position: tuple[float, float, float]
    color: tuple[float, float, float]
    normal: tuple[float, float, float] | None = None
    lamp: str = "lamps"


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What is rendered.

    Attributes:
        parts: all surfaces that stand.
        materials: by name.
        lights: all lights.
        moving: surfaces whose vertices are elsewhere in each frame; they throw neither light nor shadow.
    """

    parts: Sequence[Part]
    materials: Mapping[str, Material]
    lights: Sequence[Light]
    moving: Sequence[Part] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """All parts in one set of arrays.

    Attributes:
        vertices: (V, 3) metres.
        normals: (V, 3) unit.
        uvs: (V, 2).
        triangles: (T, 3) int64.
        materials: (T,) int64 indices in the order of the scene's materials.
        labels: (T,) uint8 NYU40 ids.
        parts: (T,) int64 index of the part.
    """

    vertices: FloatArray
    normals: FloatArray
    uvs: FloatArray
    triangles: npt.NDArray[np.int64]
    materials: npt.NDArray[np.int64]
    labels: npt.NDArray[np.uint8]
    parts: npt.NDArray[np.int64]


def build_mesh(parts: Sequence[Part], materials: Iterable[str]) -> Mesh:
    """Join parts; ``materials`` are the names of all materials in their order."""
    names = {name: k for k, name in enumerate(materials)}
    counts = [len(part.triangles) for part in parts]
    offsets = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    return Mesh(
        vertices=np.concatenate([part.vertices for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        uvs=np.concatenate([part.uvs for part in parts]),
        triangles=np.concatenate([p.triangles + o for p, o in zip(parts, offsets, strict=True)]),
        materials=np.repeat([names[part.material] for part in parts], counts),
        labels=np.repeat(np.array([part.label for part in parts], dtype=np.uint8), counts),
        parts=np.repeat(np.arange(len(parts)), counts),
    )


def joined(first: Mesh, second: Mesh) -> Mesh:
    """Two meshes of the same materials as one."""
    return Mesh(
        vertices=np.concatenate([first.vertices, second.vertices]),
        normals=np.concatenate([first.normals, second.normals]),
        uvs=np.concatenate([first.uvs, second.uvs]),
        triangles=np.concatenate([first.triangles, second.triangles + len(first.vertices)]),
        materials=np.concatenate([first.materials, second.materials]),
        labels=np.concatenate([first.labels, second.labels]),
        parts=np.concatenate([first.parts, second.parts + first.parts.max() + 1]),
    )
