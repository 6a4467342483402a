"""Clouds as binary PLY, and meshes by Open3D."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from semslam.errors import ResultsError
from semslam.types import Cloud

if TYPE_CHECKING:
    from open3d.geometry import TriangleMesh

PLY_TYPES = {
    "float32": "float",
    "float64": "double",
    "uint8": "uchar",
    "uint16": "ushort",
    "int32": "int",
}
"""Names of numbers in PLY by those of numpy."""


def write_cloud(path: Path, cloud: Cloud, columns: Mapping[str, npt.NDArray[Any]] | None = None) -> None:
    """Write a cloud with normals, its colours where they are known, and further values of its points.

    Args:
        path: the file.
        cloud: the points.
        columns: (N,) values by the name that they get in the file.

    Raises:
        ResultsError: the file cannot be written.
    """
    fields: dict[str, npt.NDArray[Any]] = {name: cloud.points[:, i] for i, name in enumerate("xyz")}
    fields |= {name: cloud.normals[:, i] for i, name in enumerate(("nx", "ny", "nz"))}
    if cloud.colors is not None:
        fields |= {name: cloud.colors[:, i] for i, name in enumerate(("red", "green", "blue"))}
    fields |= columns or {}
    rows = np.empty(len(cloud), [(name, values.dtype.newbyteorder("<")) for name, values in fields.items()])
    for name, values in fields.items():
        rows[name] = values
    listed = "".join(f"property {PLY_TYPES[values.dtype.name]} {name}\n" for name, values in fields.items())
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(cloud)}\n{listed}end_header\n"
    try:
        path.write_bytes(header.encode("ascii") + rows.tobytes())
    except OSError as error:
        raise ResultsError(f"The map {path} cannot be written: {error.strerror or error}.") from error


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
