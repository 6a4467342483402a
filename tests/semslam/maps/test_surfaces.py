"""Clouds and meshes fused from posed views."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from semslam.config import KeyframeConfig
from semslam.errors import ResultsError
from semslam.frontend.surface import make_cloud
from semslam.geometry.se3 import exp_so3, make_transform, transform_points
from semslam.maps.cloud import fuse_cloud
from semslam.maps.mesh import fuse_mesh
from semslam.maps.ply import write_cloud, write_mesh
from semslam.maps.views import PosedView, at_edges, sample
from semslam.types import Cloud
from tests.conftest import WallDataset

TILT = make_transform(exp_so3([0.1, -0.4, 0.2]), [1.0, -2.0, 0.5])


def _views(wall: WallDataset) -> list[PosedView]:
    """The wall's views, in a world that is tilted against its own."""
    poses = TILT @ wall.ground_truth.poses
    return [PosedView(i, wall.frame(i), poses[i]) for i in range(len(wall))]


def test_samples_lie_where_the_pose_puts_them(wall: WallDataset) -> None:
    view = _views(wall)[3]
    samples = sample(view, step=4)
    assert len(samples.points) == samples.mask.sum() == 60 * 80
    inside = transform_points(np.linalg.inv(view.T_world_cam), samples.points)
    assert np.allclose(inside[:, 2], wall.depth)
    assert np.allclose(view.frame.intrinsics.project(inside), np.argwhere(samples.mask)[:, ::-1], atol=1e-3)


def test_edges_and_far_pixels_are_left_out(wall: WallDataset) -> None:
    depth = np.full((240, 320), 1.5, dtype=np.float32)
    depth[:, 100:] = 2.5
    depth[:, 200:] = 9.0
    depth[50:60] = 0.0
    assert at_edges(depth)[100, 98:102].tolist() == [False, True, True, False]
    view = replace(_views(wall)[0], frame=replace(wall.frame(0), depth=depth))
    mask = sample(view, step=1).mask
    assert not mask[:, 99:101].any()
    assert not mask[:, 200:].any()
    assert not mask[50:60].any()
    assert mask[48, 10]
    assert mask[61, 150]


def test_a_fused_wall_is_flat_faces_the_camera_and_has_its_colours(wall: WallDataset) -> None:
    cloud = fuse_cloud(_views(wall), voxel=0.05)
    local = transform_points(np.linalg.inv(TILT), cloud.points)
    assert np.allclose(local[:, 2], wall.depth, atol=1e-3)
    normals = cloud.normals @ TILT[:3, :3]
    assert np.allclose(normals, [0, 0, -1], atol=0.02)
    assert cloud.colors is not None
    pixels = np.rint(wall.intrinsics.project(local)).astype(int)
    inside = ((pixels >= 0) & (pixels < (320, 240))).all(axis=1)
    true = wall.frame(0).color[pixels[inside, 1], pixels[inside, 0]].astype(float)
    assert np.corrcoef(true.ravel(), cloud.colors[inside].ravel())[0, 1] > 0.5


def test_a_mesh_is_the_wall_and_always_the_same(wall: WallDataset) -> None:
    meshes = [fuse_mesh(_views(wall), voxel=0.04) for _ in range(2)]
    vertices = [np.asarray(mesh.vertices) for mesh in meshes]
    assert len(meshes[0].triangles) > 1000
    local = transform_points(np.linalg.inv(TILT), vertices[0])
    assert np.abs(local[:, 2] - wall.depth).max() < 0.01
    assert np.asarray(meshes[0].vertex_colors).max() <= 1.0
    assert np.asarray(meshes[0].vertex_colors).std() > 0.05
    assert vertices[0].tobytes() == vertices[1].tobytes()
    assert np.asarray(meshes[0].triangles).tobytes() == np.asarray(meshes[1].triangles).tobytes()


def test_distortion_is_taken_out_of_a_mesh(wall: WallDataset) -> None:
    bent = replace(wall.intrinsics, distortion=(0.2, -0.1, 0.0, 0.0, 0.0))
    views = [replace(view, frame=replace(view.frame, intrinsics=bent)) for view in _views(wall)[:4]]
    plain = np.asarray(fuse_mesh(_views(wall)[:4], 0.04).vertices)
    ideal = np.asarray(fuse_mesh(views, 0.04).vertices)
    assert np.ptp(ideal, axis=0).max() < np.ptp(plain, axis=0).max() - 0.02


def test_a_cloud_goes_through_ply(wall: WallDataset, tmp_path: Path) -> None:
    cloud = make_cloud(wall.frame(0), KeyframeConfig())
    write_cloud(tmp_path / "map.ply", cloud)
    read = o3d.io.read_point_cloud(str(tmp_path / "map.ply"))
    assert np.array_equal(np.asarray(read.points).astype(np.float32), cloud.points)
    assert np.allclose(np.asarray(read.normals), cloud.normals)
    assert cloud.colors is not None
    assert np.array_equal(np.rint(np.asarray(read.colors) * 255), cloud.colors)


def test_what_cannot_be_written_is_one_sentence(wall: WallDataset, tmp_path: Path) -> None:
    cloud = Cloud(np.zeros((1, 3), np.float32), np.zeros((1, 3), np.float32))
    with pytest.raises(ResultsError, match="cannot be written"):
        write_cloud(tmp_path / "missing" / "map.ply", cloud)
    with pytest.raises(ResultsError, match="cannot be written"):
        write_mesh(tmp_path / "missing" / "mesh.ply", fuse_mesh(_views(wall), 0.1))
