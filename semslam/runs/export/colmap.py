"""A run's keyframes as COLMAP's text model (https://colmap.github.io/format.html)."""

from collections.abc import Sequence
from pathlib import Path

from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import invert, rotations_to_quaternions
from semslam.runs.export.posed_images import PosedImage, PosedModel


def _write(directory: Path, camera: Intrinsics, images: Sequence[PosedImage]) -> None:
    """Write ``sparse/0/{cameras,images,points3D}.txt``; no points."""
    model = directory / "sparse" / "0"
    model.mkdir(parents=True)
    (model / "cameras.txt").write_text(_camera(camera), encoding="utf-8")
    (model / "images.txt").write_text(_images(images), encoding="utf-8")
    (model / "points3D.txt").write_text("# POINT3D_ID X Y Z R G B ERROR TRACK[]\n", encoding="utf-8")


def _camera(camera: Intrinsics) -> str:
    """The simplest of COLMAP's models that has all the coefficients."""
    values = [camera.fx, camera.fy, camera.cx, camera.cy]
    k1, k2, p1, p2, *higher = camera.distortion
    if not camera.is_distorted:
        model = "PINHOLE"
    elif not any(higher):
        model, values = "OPENCV", [*values, k1, k2, p1, p2]
    else:
        k3, k4, k5, k6 = higher if len(higher) == 4 else (*higher, 0.0, 0.0, 0.0)
        model, values = "FULL_OPENCV", [*values, k1, k2, p1, p2, k3, k4, k5, k6]
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


COLMAP = PosedModel(depth=False, rational=True, write=_write)
