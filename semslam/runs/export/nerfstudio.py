"""A run's keyframes as nerfstudio's ``transforms.json`` (https://docs.nerf.studio/quickstart/data_conventions.html)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from semslam.geometry.camera import Intrinsics
from semslam.runs.export.posed_images import DEPTH_SCALE, DEPTHS, IMAGES, PosedImage, PosedModel
from semslam.runs.files import write_json

FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
"""Its cameras look along -z with y up (OpenGL's), ours along z with y down."""


def _write(directory: Path, camera: Intrinsics, images: Sequence[PosedImage]) -> None:
    k1, k2, p1, p2, k3 = map(float, camera.distortion)
    write_json(
        directory / "transforms.json",
        {
            "camera_model": "OPENCV",
            "w": camera.width,
            "h": camera.height,
            "fl_x": float(camera.fx),
            "fl_y": float(camera.fy),
            "cx": float(camera.cx),
            "cy": float(camera.cy),
            "k1": k1,
            "k2": k2,
            "k3": k3,
            "p1": p1,
            "p2": p2,
            "depth_unit_scale_factor": 1.0 / DEPTH_SCALE,
            "frames": [
                {
                    "file_path": f"{IMAGES}/{image.name}",
                    "depth_file_path": f"{DEPTHS}/{image.name}",
                    "transform_matrix": (image.pose @ FROM_OPENCV).tolist(),
                }
                for image in images
            ],
        },
    )


NERFSTUDIO = PosedModel(depth=True, rational=False, write=_write)
