"""The map as a triangle mesh: a truncated signed distance fused over the views (Curless and Levoy, SIGGRAPH 1996)."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import cv2
import numpy as np

from semslam.geometry.se3 import invert
from semslam.maps.ply import tensor
from semslam.maps.views import MAX_DEPTH, PosedView, at_edges

if TYPE_CHECKING:
    from open3d.geometry import TriangleMesh

VOXEL = 0.02
"""Metres."""
TRUNCATION = 4.0
"""Voxels; distances beyond are cut off."""
MIN_WEIGHT = 2.0
"""Views that must have seen a cell for it to be part of the surface."""
BLOCK, BLOCKS = 8, 20_000
"""Cells along the side of a block, and blocks that there is room for at first."""


def fuse_mesh(views: Iterable[PosedView], voxel: float = VOXEL) -> "TriangleMesh":
    """Fuse the depth and colour of all views and extract the surface, by Open3D.

    Args:
        views: the keyframes of one map.
        voxel: side of a cell in metres.

    Returns:
        Vertices with colours and normals; the same views give the same mesh, in the same order.
    """
    import open3d as o3d

    values = (o3d.core.float32, o3d.core.uint16, o3d.core.uint16)
    shapes = [o3d.core.SizeVector([size]) for size in (1, 1, 3)]
    grid = o3d.t.geometry.VoxelBlockGrid(("tsdf", "weight", "color"), values, shapes, voxel, BLOCK, BLOCKS)
    for view in views:
        camera, depth = view.frame.intrinsics, np.where(at_edges(view.frame.depth), np.float32(0), view.frame.depth)
        color = camera.undistort_image(view.frame.color, cv2.INTER_LINEAR).astype(np.float32)
        matrix, T_cam_world = tensor(camera.matrix), tensor(invert(view.T_world_cam))
        photo = o3d.t.geometry.Image(tensor(color))
        image = o3d.t.geometry.Image(tensor(camera.undistort_image(depth, cv2.INTER_NEAREST)))
        seen = grid.compute_unique_block_coordinates(image, matrix, T_cam_world, 1.0, MAX_DEPTH, TRUNCATION)
        grid.integrate(seen, image, photo, matrix, matrix, T_cam_world, 1.0, MAX_DEPTH, TRUNCATION)
    return _ordered(grid.extract_triangle_mesh(MIN_WEIGHT).to_legacy())


def _ordered(mesh: "TriangleMesh") -> "TriangleMesh":
    """The mesh with vertices and triangles in the order of their places: extraction leaves them as threads finish."""
    import open3d as o3d

    vertices = np.asarray(mesh.vertices)
    order = np.lexsort(vertices.T[::-1])
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    triangles = place[np.asarray(mesh.triangles)].reshape(-1, 3)
    first = triangles.argmin(axis=1) if len(triangles) else np.zeros(0, dtype=np.int64)
    turned = np.take_along_axis(triangles, (first[:, None] + np.arange(3)) % 3, axis=1)
    ordered = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(vertices[order]),
        o3d.utility.Vector3iVector(turned[np.lexsort(turned.T[::-1])].astype(np.int32)),
    )
    ordered.vertex_colors = o3d.utility.Vector3dVector(np.asarray(mesh.vertex_colors).reshape(-1, 3)[order] / 255.0)
    ordered.compute_vertex_normals()
    return ordered
