"""A scene: triangles with materials and labels, and the lights in it."""

from collections.abc import Mapping, Sequence
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
        parts: all surfaces.
        materials: by name.
        lights: all lights.
    """

    parts: Sequence[Part]
    materials: Mapping[str, Material]
    lights: Sequence[Light]


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


def build_mesh(scene: Scene) -> Mesh:
    """Join the parts of a scene."""
    names = {name: k for k, name in enumerate(scene.materials)}
    counts = [len(part.triangles) for part in scene.parts]
    offsets = np.cumsum([0] + [len(part.vertices) for part in scene.parts[:-1]])
    return Mesh(
        vertices=np.concatenate([part.vertices for part in scene.parts]),
        normals=np.concatenate([part.normals for part in scene.parts]),
        uvs=np.concatenate([part.uvs for part in scene.parts]),
        triangles=np.concatenate([p.triangles + o for p, o in zip(scene.parts, offsets, strict=True)]),
        materials=np.repeat([names[part.material] for part in scene.parts], counts),
        labels=np.repeat(np.array([part.label for part in scene.parts], dtype=np.uint8), counts),
        parts=np.repeat(np.arange(len(scene.parts)), counts),
    )
