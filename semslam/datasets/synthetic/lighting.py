"""Light baked once at the vertices: direct light with shadows, and three bounces of what the surfaces throw back.

The scene does not move while it is seen, so this costs nothing per frame. Daylight and lamps are kept apart:
any mixture of them is a weighted sum.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from semslam.datasets.synthetic import labels
from semslam.datasets.synthetic.casting import RayCaster
from semslam.datasets.synthetic.scene import Light, Mesh
from semslam.geometry.se3 import Float32Array, FloatArray

LAMPS = ("day", "lamps")
DIRECTIONS = 48
BOUNCES = 3
REFLECTED = 0.85
"""Share of a surface's colour that counts when it lights others: surfaces are a little dirty where it matters."""
LIFT, LIFT_OFF_WALLS = 0.012, 0.04
"""Metres by which rays start off the surface; off walls they clear picture frames, whose shade would be too wide."""
CHUNK = 1 << 19


def bake(mesh: Mesh, albedo: FloatArray, lights: Sequence[Light], caster: RayCaster) -> Float32Array:
    """Irradiance at every vertex, (2, V, 3) float32: by daylight, by lamps; 1 shows a surface in its own colour.

    Args:
        mesh: the scene's triangles.
        albedo: (T, 3) mean linear reflectance of the triangles.
        lights: all lights.
        caster: ray casting against the mesh.
    """
    origins = _lifted(mesh)
    direct = np.zeros((len(LAMPS), len(mesh.vertices), 3), dtype=np.float32)
    for light in lights:
        lit, strength = _reached(light, origins, mesh.normals, caster)
        direct[LAMPS.index(light.lamp), lit] += strength[:, None] * np.asarray(light.color, dtype=np.float32)
    seen = _surroundings(origins, mesh.normals, caster, len(mesh.triangles))
    reflectance = (REFLECTED * albedo).astype(np.float32)
    total: Float32Array = direct
    for _ in range(BOUNCES):
        # The last row stands for rays that meet nothing.
        thrown = np.zeros((len(mesh.triangles) + 1, len(LAMPS) * 3), dtype=np.float32)
        for k in range(len(LAMPS)):
            thrown[:-1, 3 * k : 3 * k + 3] = reflectance * total[k].take(mesh.triangles, axis=0).mean(1)
        gathered = np.zeros((len(mesh.vertices), len(LAMPS) * 3), dtype=np.float32)
        for column in seen:
            gathered += thrown.take(column, axis=0)
        total = direct + gathered.reshape(-1, len(LAMPS), 3).transpose(1, 0, 2) / np.float32(len(seen))
    return total


def _lifted(mesh: Mesh) -> FloatArray:
    """Vertices moved off their surface and a little inwards, so that those in a corner see into the room."""
    corners = mesh.vertices[mesh.triangles]
    inwards = corners.mean(1, keepdims=True) - corners
    inwards *= np.minimum(1.0, 0.02 / np.maximum(np.linalg.norm(inwards, axis=2, keepdims=True), 1e-9))
    indices = mesh.triangles.ravel()
    count = np.maximum(np.bincount(indices, minlength=len(mesh.vertices)), 1)
    shifts = [np.bincount(indices, inwards[..., k].ravel(), len(mesh.vertices)) / count for k in range(3)]
    lift = np.full((len(mesh.vertices), 1), LIFT)
    lift[np.unique(mesh.triangles[mesh.labels == labels.WALL])] = LIFT_OFF_WALLS
    return np.asarray(mesh.vertices + lift * mesh.normals + np.stack(shifts, -1))


def _reached(
    light: Light, origins: FloatArray, normals: FloatArray, caster: RayCaster
) -> tuple[npt.NDArray[np.int64], Float32Array]:
    """Vertices that a light reaches, and how strongly."""
    towards = np.asarray(light.position) - origins
    squared = np.einsum("ij,ij->i", towards, towards)
    cosine = np.maximum(np.einsum("ij,ij->i", towards, normals), 0) / np.sqrt(squared)
    if light.normal is not None:
        cosine *= np.maximum(0, -(towards @ np.asarray(light.normal))) / np.sqrt(squared)
    strength = cosine / (squared + 0.05)
    lit = np.flatnonzero(strength * max(light.color) > 2e-3)
    rays = np.hstack([origins[lit], towards[lit]]).astype(np.float32)
    lit = lit[~caster.blocked(rays, 0.98)]
    return lit, strength[lit].astype(np.float32)


def _surroundings(origins: FloatArray, normals: FloatArray, caster: RayCaster, nothing: int) -> npt.NDArray[np.int64]:
    """Triangle seen in each of a few directions spread by the cosine law, (K, V); ``nothing`` where there is none."""
    k = np.arange(DIRECTIONS)
    radius, angle = np.sqrt((k + 0.5) / DIRECTIONS), k * np.pi * (3 - np.sqrt(5))
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - radius**2)], -1).astype(np.float32)
    helper = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    x = np.cross(helper, normals)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    basis = np.stack([x, np.cross(normals, x), normals], 1).astype(np.float32)
    seen = np.empty((DIRECTIONS, len(origins)), dtype=np.int64)
    step = CHUNK // DIRECTIONS
    for start in range(0, len(origins), step):
        block = slice(start, start + step)
        directions = local @ basis[block]
        starts = np.broadcast_to(origins[block, None].astype(np.float32), directions.shape)
        hits = caster.cast(np.concatenate([starts, directions], -1).reshape(-1, 6))
        seen[:, block] = np.where(hits.seen, hits.triangles, nothing).reshape(-1, DIRECTIONS).T
    return seen
