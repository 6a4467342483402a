"""Ray casting against a set of triangles, by Open3D."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import Float32Array, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """What N rays meet first.

    Attributes:
        seen: (N,) whether there is anything.
        distance: (N,) float32 in lengths of the ray's direction; 0 where nothing is.
        triangles: (N,) int64 indices; 0 where nothing is.
        weights: (N, 2) float32 barycentric weights of the triangle's second and third corner.
        normals: (N, 3) float32 of the triangles, unit, unoriented.
    """

    seen: npt.NDArray[np.bool_]
    distance: Float32Array
    triangles: npt.NDArray[np.int64]
    weights: Float32Array
    normals: Float32Array


class Caster(Protocol):
    """Casts rays, (N, 6) float32 of origin and direction."""

    def cast(self, rays: Float32Array) -> Hits:
        """First hit of each ray."""


class RayCaster:
    """Casts rays, (N, 6) float32 of origin and direction.

    Args:
        vertices: (V, 3) metres.
        triangles: (T, 3) vertex indices.
    """

    def __init__(self, vertices: FloatArray, triangles: npt.NDArray[np.int64]) -> None:
        import open3d as o3d

        # One thread builds the tree, so that rays that meet two triangles at once choose the same one every time.
        self._scene: Any = o3d.t.geometry.RaycastingScene(nthreads=1)
        self._scene.add_triangles(_tensor(vertices.astype(np.float32)), _tensor(triangles.astype(np.uint32)))

    def cast(self, rays: Float32Array) -> Hits:
        """First hit of each ray."""
        found = self._scene.cast_rays(_tensor(rays))
        distance = found["t_hit"].numpy()
        seen = np.isfinite(distance)
        triangles = np.where(seen, found["primitive_ids"].numpy(), 0).astype(np.int64)
        weights, normals = found["primitive_uvs"].numpy(), found["primitive_normals"].numpy()
        return Hits(seen, np.where(seen, distance, np.float32(0)), triangles, weights, normals)

    def blocked(self, rays: Float32Array, far: float) -> npt.NDArray[np.bool_]:
        """Whether anything lies on each ray nearer than ``far`` lengths of its direction, (N,)."""
        return np.asarray(self._scene.test_occlusions(_tensor(rays), 0.0, far).numpy(), dtype=bool)


class TwoCasters:
    """Two sets of triangles as one, such as what stands and what moves.

    Args:
        first: the one.
        second: the other; where both are hit at the same distance, the first counts.
        offset: added to the second's triangles.
    """

    def __init__(self, first: Caster, second: Caster, offset: int) -> None:
        self._first, self._second, self._offset = first, second, offset

    def cast(self, rays: Float32Array) -> Hits:
        """First hit of each ray."""
        a, b = self._first.cast(rays), self._second.cast(rays)
        nearer = b.seen & (~a.seen | (b.distance < a.distance))
        return Hits(
            a.seen | b.seen,
            np.where(nearer, b.distance, a.distance),
            np.where(nearer, b.triangles + self._offset, a.triangles),
            np.where(nearer[:, None], b.weights, a.weights),
            np.where(nearer[:, None], b.normals, a.normals),
        )


def _tensor(array: Any) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(array))
