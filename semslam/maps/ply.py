"""Clouds and meshes as PLY, by Open3D."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from semslam.errors import ResultsError
from semslam.types import Cloud

if TYPE_CHECKING:
    from open3d.geometry import TriangleMesh


def write_cloud(path: Path, cloud: Cloud, columns: Mapping[str, npt.NDArray[Any]] | None = None) -> None:
    """Write a cloud with normals, its colours where they are known, and further values of its points.

    Args:
        path: the file.
        cloud: the points.
        columns: (N,) values by the name that they get in the file.

    Raises:
        ResultsError: the file cannot be written.
    """
    import open3d as o3d

    points = o3d.t.geometry.PointCloud(tensor(cloud.points))
    points.point["normals"] = tensor(cloud.normals)
    if cloud.colors is not None:
        points.point["colors"] = tensor(cloud.colors)
    for name, values in (columns or {}).items():
        points.point[name] = tensor(values[:, None])
    if not o3d.t.io.write_point_cloud(path, points) and len(cloud):
        raise ResultsError(f"The map {path} cannot be written.")


def write_mesh(path: Path, mesh: "TriangleMesh") -> None:
    """Write a mesh with colours and normals.

    Raises:
        ResultsError: the file cannot be written.
    """
    import open3d as o3d

    if not o3d.io.write_triangle_mesh(path, mesh) and len(mesh.triangles):
        raise ResultsError(f"The mesh {path} cannot be written.")


def tensor(array: npt.NDArray[Any]) -> Any:
    """An array as Open3D's tensor."""
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(array))
