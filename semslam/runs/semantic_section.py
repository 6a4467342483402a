"""The semantic map of a saved run on its report page."""

import json
from pathlib import Path

import cv2

from semslam.errors import ResultsError
from semslam.eval.report.content import ObjectRow, SemanticSection
from semslam.eval.report.frames import data_uri
from semslam.maps.semantic.semantic_map import JSON
from semslam.runs.manifest import read_manifest
from semslam.runs.mapping import PLAN

JPEG_QUALITY = 80


def semantic_section(directory: Path) -> SemanticSection | None:
    """The semantic map in a run folder, or None where ``semslam map RUN --semantic`` was not called.

    Raises:
        ResultsError: a file of it is damaged.
    """
    manifest = read_manifest(directory)
    if JSON not in manifest.files:
        return None
    manifest.check(directory, JSON, *([PLAN] if PLAN in manifest.files else []))
    try:
        things = json.loads((directory / JSON).read_text(encoding="utf-8"))["objects"]
        rows = tuple(
            ObjectRow(
                str(thing["class"]), float(thing["confidence"]), tuple(thing["centroid_m"]), tuple(thing["extent_m"]),
                tuple(thing["keyframes"]),
            )
            for thing in things
        )  # fmt: skip
    except (KeyError, TypeError, ValueError) as error:
        raise ResultsError(f"{directory / JSON} was written by another version.") from error
    return SemanticSection(_picture(directory / PLAN) if PLAN in manifest.files else None, rows)


def _picture(path: Path) -> str:
    image = cv2.imread(str(path))
    if image is None:
        raise ResultsError(f"{path} is no picture.")
    return data_uri("jpeg", cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes())
