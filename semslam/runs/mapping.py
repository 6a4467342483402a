"""The maps of a saved run, made again from its sequence."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from semslam.maps.cloud import fuse_cloud
from semslam.maps.mesh import fuse_mesh
from semslam.maps.ply import write_cloud, write_mesh
from semslam.runs.results import writing
from semslam.runs.saved_views import SavedViews

CLOUD, MESH = "map.ply", "mesh.ply"


@dataclass(frozen=True, slots=True)
class MapRequest:
    """Which maps are wanted.

    Attributes:
        voxel: side of a cell in metres.
        mesh: whether to fuse a mesh.
    """

    voxel: float
    mesh: bool = False


def write_maps(
    saved: SavedViews, request: MapRequest, directory: Path, progress: Callable[[int, int | None], None]
) -> list[Path]:
    """Write the maps that are asked for into a folder.

    Args:
        saved: the run and its images.
        request: which maps.
        directory: made where it is missing.
        progress: called with the keyframes done and in all, from 0 again for each map.

    Returns:
        The files written.

    Raises:
        DatasetError: an image can no longer be read.
        ResultsError: a file cannot be written.
    """
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
    write_cloud(directory / CLOUD, fuse_cloud(saved.read(progress), request.voxel))
    written = [directory / CLOUD]
    if request.mesh:
        write_mesh(directory / MESH, fuse_mesh(saved.read(progress), request.voxel))
        written.append(directory / MESH)
    return written
