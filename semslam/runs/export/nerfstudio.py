"""A run's keyframes as nerfstudio's ``transforms.json`` (https://docs.nerf.studio/quickstart/data_conventions.html)."""

from pathlib import Path

import numpy as np

from semslam.datasets.dataset import Dataset
from semslam.runs.export.posed_images import DEPTH_SCALE, DEPTHS, IMAGES, write_posed_images
from semslam.runs.files import write_json
from semslam.runs.results import SavedRun

FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
"""Its cameras look along -z with y up (OpenGL's), ours along z with y down."""
PIXEL_CENTRE = 0.5
"""Its pixel (0, 0) is the corner of the first pixel, ours its centre."""


def write_nerfstudio(run: SavedRun, dataset: Dataset, directory: Path) -> int:
    """Write ``images/``, ``depth/`` (millimetres) and ``transforms.json`` into a folder.

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
    images = write_posed_images(run, dataset, directory, depth=True)
    camera = dataset.intrinsics
    k1, k2, p1, p2, k3 = map(float, camera.distortion)
    write_json(
        directory / "transforms.json",
        {
            "camera_model": "OPENCV",
            "w": camera.width,
            "h": camera.height,
            "fl_x": float(camera.fx),
            "fl_y": float(camera.fy),
            "cx": float(camera.cx) + PIXEL_CENTRE,
            "cy": float(camera.cy) + PIXEL_CENTRE,
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
    return len(images)
