"""A folder of image pairs with a CSV of truth, such as the paper's groups out of SUN RGB-D and of its own films.

``pairs.csv`` has the columns first, second (colour images), same (1 or 0) and group (viewpoint, illumination or
objects), and may have first_depth and second_depth; paths are relative to the folder. ``camera.yaml`` holds the
camera and its depth_scale.
"""

import csv
from functools import partial
from io import StringIO
from pathlib import Path

import numpy as np

from semslam.datasets.camera_file import CameraSetup, read_camera
from semslam.datasets.images import DepthScale, read_color, read_depth
from semslam.errors import DatasetError
from semslam.eval.pairs.judging import Pair, PairGroup
from semslam.files import read_text
from semslam.types import Frame

COLUMNS = ("first", "second", "same", "group")
DEPTH_COLUMNS = ("first_depth", "second_depth")
TRUTH = {"1": True, "true": True, "0": False, "false": False}


def read_pair_folder(folder: Path) -> list[Pair]:
    """Read the list of pairs; images are read when a pair is loaded.

    Raises:
        DatasetError: the CSV or camera file is missing or malformed; the message names the line.
    """
    table = folder / "pairs.csv"
    text = read_text(table, "The list of pairs", DatasetError)
    try:
        reader = csv.DictReader(StringIO(text, newline=""))
        missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
        if missing:
            raise DatasetError(f"{table} lacks the column {missing[0]}; it needs {', '.join(COLUMNS)}.")
        rows = [(reader.line_num, row) for row in reader]
    except csv.Error as error:
        raise DatasetError(f"The list of pairs {table} cannot be read: {error}.") from error
    camera = read_camera(folder / "camera.yaml")
    return [_pair(folder, camera, row, f"{table}, line {line}") for line, row in rows]


def _pair(folder: Path, camera: CameraSetup, row: dict[str, str | None], where: str) -> Pair:
    same, group = (row["same"] or "").strip().lower(), (row["group"] or "").strip().lower()
    if same not in TRUTH:
        raise DatasetError(f"{where}: 'same' must be 1 or 0, not '{same}'.")
    if group not in list(PairGroup):
        raise DatasetError(f"{where}: 'group' must be one of {', '.join(PairGroup)}, not '{group}'.")
    paths = [(row[name] or "").strip() for name in COLUMNS[:2]]
    if not all(paths):
        raise DatasetError(f"{where}: an image is not named.")
    depths = [(row.get(name) or "").strip() for name in DEPTH_COLUMNS]
    files = [(folder / color, folder / depth if depth else None) for color, depth in zip(paths, depths, strict=True)]
    return Pair(PairGroup(group), group, TRUTH[same], partial(_load, files, camera), np.stack([np.eye(4)] * 2))


def _load(files: list[tuple[Path, Path | None]], camera: CameraSetup, side: int) -> Frame:
    color_file, depth_file = files[side]
    size = (camera.intrinsics.width, camera.intrinsics.height)
    color = read_color(color_file, size)
    depth = np.zeros(color.shape[:2], np.float32)
    if depth_file is not None:
        if camera.depth_scale is None:
            raise DatasetError(f"The camera file beside {color_file.name} must state depth_scale, as there is depth.")
        depth = read_depth(depth_file, DepthScale(camera.depth_scale, camera.depth_scale), size)
    return Frame(side, float(side), color, depth, camera.intrinsics)
