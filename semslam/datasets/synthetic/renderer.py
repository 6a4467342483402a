"""Ray casting of a scene into colour, exact depth and exact labels."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from semslam.datasets.synthetic.atlas import TextureAtlas
from semslam.datasets.synthetic.casting import Caster, Hits, RayCaster, TwoCasters
from semslam.datasets.synthetic.lighting import LAMPS, bake
from semslam.datasets.synthetic.scene import Mesh, Scene, build_mesh, joined
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import Float32Array, Points3, Transform, Transforms

GAMMA = 2.2
SHOULDER = 190.0
"""Grey level above which brightness is compressed, so that windows and lampshades do not clip hard."""
AFTERGLOW = 0.06
"""What is left of a lampshade's or a window's brightness while it is off."""
SUBPIXELS = np.array([[-1 / 3, 1 / 3], [1 / 3, -1 / 3]], dtype=np.float32)
"""Where pixels at edges are cast again, besides their middle."""


@dataclass(frozen=True, slots=True)
class Lighting:
    """How the two kinds of light are mixed.

    Attributes:
        day: weight of the windows' light.
        lamps: weight of the lamps.
        tint: (3,) factors of the camera's white balance and exposure.
    """

    day: float = 1.0
    lamps: float = 0.5
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What a perfect camera sees.

    Attributes:
        color: (H, W, 3) float32, sRGB 0..255.
        depth: (H, W) float32 metres along the optical axis; 0 where nothing is.
        labels: (H, W) uint8 NYU40 ids; 0 where nothing is.
        cosine: (H, W) float32 between the ray and the surface's normal.
    """

    color: Float32Array
    depth: Float32Array
    labels: npt.NDArray[np.uint8]
    cosine: Float32Array


class Renderer:
    """Renders one scene; building it bakes the light, which takes a few seconds.

    Args:
        scene: what is rendered.
    """

    def __init__(self, scene: Scene) -> None:
        still = self._mesh = build_mesh(scene.parts, scene.materials)
        self._caster = RayCaster(still.vertices, still.triangles)
        self._atlas = TextureAtlas(scene.materials)
        self._light = bake(still, self._atlas.mean_albedo[still.materials], scene.lights, self._caster)
        _add_glow(self._light, scene, still)
        self._moving: Mesh | None = None
        if scene.moving:
            self._moving = build_mesh(scene.moving, scene.materials)
            self._mesh = joined(still, self._moving)
            self._light = np.concatenate([self._light, _ambient(self._light, self._moving)], axis=1)
        tiles = self._atlas.tiles[self._mesh.materials][:, None]
        self._uvs = (self._mesh.uvs[self._mesh.triangles] / tiles).astype(np.float32)
        self._density = _density(self._mesh, self._uvs, self._atlas.size)
        self._tables: dict[Lighting, Float32Array] = {}

    def render(
        self,
        poses: Transform | Transforms,
        camera: Intrinsics,
        lighting: Lighting,
        moving: Points3 | None = None,
    ) -> View:
        """One view without any of the sensor's faults.

        Args:
            poses: T_world_cam, (4, 4), or (H, 4, 4) where each row is exposed from a pose of its own.
            camera: the camera.
            lighting: how the light is mixed.
            moving: (V, 3) where the vertices of the scene's moving parts are; None = those are not there.
        """
        shape = camera.height, camera.width
        caster = self._caster_with(moving)
        directions = _directions(camera).reshape(-1, 3)
        hits, cosine = _cast(caster, poses, directions, np.arange(len(directions)) // camera.width)
        color = self._shade(hits, cosine, directions, camera, lighting)
        edges = np.flatnonzero(self._edges(hits, cosine, shape))
        fine = directions[edges].repeat(len(SUBPIXELS), axis=0)
        fine[:, :2] += np.tile(SUBPIXELS / (camera.fx, camera.fy), (len(edges), 1)).astype(np.float32)
        rows = (edges // camera.width).repeat(len(SUBPIXELS))
        again = self._shade(*_cast(caster, poses, fine, rows), fine, camera, lighting)
        color[edges] = (color[edges] + again.reshape(len(edges), len(SUBPIXELS), 3).sum(1)) / (1 + len(SUBPIXELS))
        labels = np.where(hits.seen, self._mesh.labels[hits.triangles], 0).astype(np.uint8)
        return View(
            color.reshape(*shape, 3), hits.distance.reshape(shape), labels.reshape(shape), cosine.reshape(shape)
        )

    def measure(
        self, poses: Transform | Transforms, camera: Intrinsics, moving: Points3 | None = None
    ) -> tuple[Float32Array, Float32Array]:
        """Exact depth and cosine of incidence (H, W) alone, as in ``View``; arguments as for ``render``."""
        shape = camera.height, camera.width
        directions = _directions(camera).reshape(-1, 3)
        rows = np.arange(len(directions)) // camera.width
        hits, cosine = _cast(self._caster_with(moving), poses, directions, rows)
        return hits.distance.reshape(shape), cosine.reshape(shape)

    def _caster_with(self, moving: Points3 | None) -> Caster:
        if moving is None or self._moving is None:
            return self._caster
        offset = len(self._mesh.triangles) - len(self._moving.triangles)
        return TwoCasters(self._caster, RayCaster(moving, self._moving.triangles), offset)

    def _shade(
        self, hits: Hits, cosine: Float32Array, directions: Float32Array, camera: Intrinsics, lighting: Lighting
    ) -> Float32Array:
        rows = self._table(lighting).take(hits.triangles, axis=0)
        values = rows[:, :5] + hits.weights[:, :1] * rows[:, 5:10] + hits.weights[:, 1:] * rows[:, 10:]
        # Between the footprint's short and long axis: a little blur along grazing surfaces rather than shimmer.
        footprint = hits.distance * _length(directions) / (camera.fx * np.maximum(cosine, 0.03) ** 0.6)
        lod = np.log2(np.maximum(footprint, 1e-6)) + self._density.take(hits.triangles)
        color = self._atlas.lookup(self._mesh.materials.take(hits.triangles), values[:, :2], lod)
        color *= values[:, 2:]
        over = color > SHOULDER
        rest = 255 - SHOULDER
        color[over] = 255 - rest * np.exp((SHOULDER - color[over]) / rest)
        color[~hits.seen] = 0
        return color

    def _table(self, lighting: Lighting) -> Float32Array:
        """Texture coordinates and factors of the sRGB albedo, (T, 15): at the first corner, and along two edges."""
        if lighting not in self._tables:
            weights = (lighting.day, lighting.lamps)
            light = sum(w * part for w, part in zip(weights, self._light, strict=True)) * np.asarray(lighting.tint)
            shades = np.asarray(light, dtype=np.float32) ** np.float32(1 / GAMMA)
            corners = np.concatenate([self._uvs, shades.take(self._mesh.triangles, axis=0)], -1)
            corners[:, 1:] -= corners[:, :1]
            self._tables[lighting] = corners.reshape(-1, 15)
        return self._tables[lighting]

    def _edges(self, hits: Hits, cosine: Float32Array, shape: tuple[int, int]) -> npt.NDArray[np.bool_]:
        """Pixels beside another part or at a crease, (H, W)."""
        part = self._mesh.parts.take(hits.triangles).reshape(shape)
        depth, cosine = hits.distance.reshape(shape), cosine.reshape(shape)
        edge = np.zeros(shape, dtype=bool)
        row, column = slice(None), (slice(1, None), slice(-1))
        for a, b in (((row, column[0]), (row, column[1])), ((column[0], row), (column[1], row))):
            step = (part[a] != part[b]) & (np.abs(depth[a] - depth[b]) + np.abs(cosine[a] - cosine[b]) > 1e-3)
            step |= (np.abs(depth[a] - depth[b]) > 0.1 * depth[a]) | (np.abs(cosine[a] - cosine[b]) > 0.15)
            edge[a] |= step
            edge[b] |= step
        return edge


def _cast(
    caster: Caster, poses: Transform | Transforms, directions: Float32Array, rows: npt.NDArray[np.int64]
) -> tuple[Hits, Float32Array]:
    """Hits of directions (N, 3) with z = 1, whose distance is then the depth; and cosines of incidence (N,)."""
    rays = _rays(poses, directions, rows)
    hits = caster.cast(rays)
    along = hits.normals[:, 0] * rays[:, 3] + hits.normals[:, 1] * rays[:, 4] + hits.normals[:, 2] * rays[:, 5]
    return hits, np.abs(along) / _length(directions)


def _rays(poses: Transform | Transforms, directions: Float32Array, rows: npt.NDArray[np.int64]) -> Float32Array:
    """Rays (N, 6) of directions (N, 3) in image rows (N,), from one pose or one for each row."""
    rays = np.empty((len(directions), 6), dtype=np.float32)
    if poses.ndim == 2:
        rays[:, :3] = poses[:3, 3]
        rays[:, 3:] = directions @ poses[:3, :3].T.astype(np.float32)
    else:
        rays[:, :3] = poses[rows, :3, 3]
        rays[:, 3:] = np.einsum("nij,nj->ni", poses[:, :3, :3].astype(np.float32)[rows], directions)
    return rays


def _length(directions: Float32Array) -> Float32Array:
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", directions, directions)))


def _directions(camera: Intrinsics) -> Float32Array:
    rays = camera.rays()
    return np.concatenate([rays, np.ones_like(rays[..., :1])], -1)


def _density(mesh: Mesh, uvs: Float32Array, size: int) -> Float32Array:
    """Log2 of the texels along a metre of each triangle, (T,)."""
    corners = mesh.vertices[mesh.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    p, q = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    shown = np.abs(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
    return np.asarray(
        np.log2(size) + 0.5 * np.log2(np.maximum(shown, 1e-12) / np.maximum(area, 1e-12)), dtype=np.float32
    )


def _ambient(light: Float32Array, mesh: Mesh) -> Float32Array:
    """Light (2, V, 3) on what moves: that of the scene in the mean, more from above, without shadows."""
    upwards = (0.9 + 0.3 * mesh.normals[:, 2] + 0.15 * mesh.normals[:, 0]).astype(np.float32)
    return np.asarray(light.mean(1, keepdims=True) * upwards[:, None], dtype=np.float32)


def _add_glow(light: Float32Array, scene: Scene, mesh: Mesh) -> None:
    """Give surfaces that shine by themselves the brightness of their material."""
    for index, material in enumerate(scene.materials.values()):
        if material.glow > 0:
            vertices = np.unique(mesh.triangles[mesh.materials == index])
            light[:, vertices] = AFTERGLOW * material.glow
            light[LAMPS.index(material.lamp), vertices] = material.glow
