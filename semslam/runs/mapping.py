"""Makes the maps of a saved run from its sequence."""

from dataclasses import dataclass
from pathlib import Path

import cv2

from semslam.loop.segmentation.build import build_segmenter
from semslam.maps.cloud import fuse_cloud
from semslam.maps.mesh import fuse_mesh
from semslam.maps.ply import write_cloud, write_mesh
from semslam.maps.semantic.plan import draw_plan
from semslam.maps.semantic.semantic_map import VOXEL, SemanticMap, build_semantic_map, write_semantic_map
from semslam.runs.files import writing
from semslam.runs.saved_views import Progress, SavedViews, silent

CLOUD, MESH, PLAN = "map.ply", "mesh.ply", "semantic.png"
DENSE_VOXEL = 0.02
"""Metres, of cloud and mesh: they show what the sensor resolves."""


@dataclass(frozen=True, slots=True)
class MapRequest:
    """Which maps are wanted.

    Attributes:
        voxel: side of a cell in metres; None = that of each kind of map.
        mesh: whether to fuse a mesh.
        semantic: whether to fuse labels and find objects.
    """

    voxel: float | None = None
    mesh: bool = False
    semantic: bool = False


def write_maps(saved: SavedViews, request: MapRequest, directory: Path, progress: Progress) -> list[Path]:
    """Write the requested maps into a folder.

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
    write_cloud(directory / CLOUD, fuse_cloud(saved.read(progress), request.voxel or DENSE_VOXEL))
    written = [directory / CLOUD]
    if request.mesh:
        write_mesh(directory / MESH, fuse_mesh(saved.read(progress), request.voxel or DENSE_VOXEL))
        written.append(directory / MESH)
    if request.semantic:
        built = semantic_map(saved, request.voxel, progress)
        written += write_semantic_map(directory, built)
        if len(built.cloud):
            cv2.imwrite(str(directory / PLAN), cv2.cvtColor(draw_plan(built), cv2.COLOR_RGB2BGR))
            written.append(directory / PLAN)
    return written


def semantic_map(saved: SavedViews, voxel: float | None, progress: Progress = silent) -> SemanticMap:
    """The semantic map of a saved run, its keyframes labelled by the segmenter of its settings.

    Args:
        saved: the run and its images.
        voxel: side of a cell in metres; None = 4 cm.
        progress: called with the keyframes done and in all.

    Raises:
        DatasetError: an image can no longer be read.
        ModelError: the network's weights cannot be used.
    """
    return build_semantic_map(saved.read(progress), build_segmenter(saved.run.config), voxel or VOXEL)
