"""A run's keyframes as COLMAP's text model (https://colmap.github.io/format.html)."""

from collections.abc import Sequence
from pathlib import Path

from semslam.datasets.dataset import Dataset
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import invert, rotations_to_quaternions
from semslam.runs.export.posed_images import PosedImage, write_posed_images
from semslam.runs.results import SavedRun

PIXEL_CENTRE = 0.5
"""COLMAP's pixel (0, 0) is the corner of the first pixel, ours its centre."""


def write_colmap(run: SavedRun, dataset: Dataset, directory: Path) -> int:
    """Write ``images/`` and ``sparse/0/{cameras,images,points3D}.txt`` into a folder; no points.

    Args:
        run: the run; its keyframes of the largest map are written.
        dataset: its sequence.
        directory: an empty folder.

    Returns:
        How many images were written.

    Raises:
        ResultsError: the dataset is another sequence than the run's.
        DatasetError: an image cannot be read.
    """
    images = write_posed_images(run, dataset, directory, depth=False)
    model = directory / "sparse" / "0"
    model.mkdir(parents=True)
    (model / "cameras.txt").write_text(_camera(dataset.intrinsics), encoding="utf-8")
    (model / "images.txt").write_text(_images(images), encoding="utf-8")
    (model / "points3D.txt").write_text("# POINT3D_ID X Y Z R G B ERROR TRACK[]\n", encoding="utf-8")
    return len(images)


def _camera(camera: Intrinsics) -> str:
    values = [camera.fx, camera.fy, camera.cx + PIXEL_CENTRE, camera.cy + PIXEL_CENTRE]
    k1, k2, p1, p2, k3 = camera.distortion
    if not any(camera.distortion):
        model = "PINHOLE"
    elif k3 == 0:
        model, values = "OPENCV", [*values, k1, k2, p1, p2]
    else:
        model, values = "FULL_OPENCV", [*values, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]
    numbers = " ".join(map(repr, map(float, values)))
    return f"# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n1 {model} {camera.width} {camera.height} {numbers}\n"


def _images(images: Sequence[PosedImage]) -> str:
    """A line for each image's T_cam_world, real part of the quaternion first, and an empty line of points."""
    lines = ["# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME", "# POINTS2D[] as (X, Y, POINT3D_ID)"]
    for number, image in enumerate(images, start=1):
        T_cam_world = invert(image.pose)
        x, y, z, w = rotations_to_quaternions(T_cam_world[None, :3, :3])[0].tolist()
        numbers = " ".join(map(repr, (w, x, y, z, *T_cam_world[:3, 3].tolist())))
        lines += [f"{number} {numbers} 1 {image.name}", ""]
    return "\n".join([*lines, ""])
