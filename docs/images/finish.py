"""The last step of make.sh, finish.py WORK IMAGES: draws the mesh and writes all pictures as JPEG."""

import sys
from pathlib import Path

import cv2
import numpy as np
import open3d as o3d

WIDTH, QUALITY = 1400, 72
SIZE, FIELD_OF_VIEW = (1400, 900), 50.0
CUT = 2.1
"""Metres above the floor at which the room is cut open."""


def draw_mesh(file: Path) -> np.ndarray:
    """The mesh from above, without the walls that would hide it, (H, W, 3) BGR.

    The run's world has y down and starts at the first camera; Open3D's ``up`` points down in the image.
    """
    mesh = o3d.io.read_triangle_mesh(str(file))
    points = np.asarray(mesh.vertices)
    floor = np.percentile(points[:, 1], 99)
    mesh.remove_vertices_by_mask(points[:, 1] < floor - CUT)
    points, colors, faces = (np.asarray(part) for part in (mesh.vertices, mesh.vertex_colors, mesh.triangles))
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    eye = middle + np.linalg.norm(high - low) * np.array([0.0, -0.6, -0.85])
    mesh.compute_triangle_normals()
    towards = eye - points[faces].mean(axis=1)
    mesh.remove_triangles_by_mask((np.asarray(mesh.triangle_normals) * towards).sum(axis=1) <= 0)
    faces = np.asarray(mesh.triangles)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    rays = scene.create_rays_pinhole(FIELD_OF_VIEW, middle, eye, [0, 1, 0], *SIZE)
    hit = scene.cast_rays(rays)
    seen = np.isfinite(hit["t_hit"].numpy())
    corners, (u, v) = faces[hit["primitive_ids"].numpy()[seen]], hit["primitive_uvs"].numpy()[seen].T
    weights = np.stack([1 - u - v, u, v], axis=1)
    image = np.full((SIZE[1], SIZE[0], 3), 255, np.uint8)
    image[seen] = np.rint(255 * (weights[..., None] * colors[corners]).sum(axis=1).clip(0, 1))[:, ::-1]
    return image


def beside(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Two pictures of one height."""
    height = min(len(left), len(right))
    return np.hstack([cv2.resize(i, (i.shape[1] * height // len(i), height)) for i in (left, right)])


def main(work: Path, images: Path) -> None:
    """Write all pictures."""
    pictures = {
        "mesh": draw_mesh(work / "room" / "mesh.ply"),
        "semantic-map": cv2.imread(str(work / "room" / "semantic.png")),
        "viewer": cv2.imread(str(work / "viewer.png")),
        "report": cv2.imread(str(work / "report.png")),
        "plots": beside(*(cv2.imread(str(work / "plots" / f"{name}.png")) for name in ("trajectory", "error"))),
    }
    for name, picture in pictures.items():
        scale = min(1.0, WIDTH / picture.shape[1])
        small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(images / f"{name}.jpg"), small, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]))
