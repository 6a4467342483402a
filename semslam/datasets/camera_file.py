"""camera.yaml: the camera of a sequence, written beside its images."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from semslam.config.strict_yaml import load_yaml
from semslam.datasets.images import DepthScale
from semslam.errors import ConfigError, DatasetError, shortened
from semslam.files import read_text
from semslam.geometry.camera import COEFFICIENTS, NO_DISTORTION, Intrinsics

CAMERA_FILE = "camera.yaml"
_REQUIRED = ("width", "height", "fx", "fy", "cx", "cy")
_TIMES = ("readout", "delay", "depth_readout")
_OPTIONAL = ("distortion", "depth_scale", *_TIMES)
MAX_FILE_BYTES = 1_000_000
MAX_NUMBER = 1e9
"""No size, focal length or depth scale comes near to it."""


@dataclass(frozen=True, slots=True)
class CameraSetup:
    """What turns a sequence's files into metres.

    Attributes:
        intrinsics: the camera; fy is positive.
        depth_scale: units of the depth images per metre, or None where the source states none.
        scale_stated: whether a user or the sequence's own file states it, so that it holds for floating-point
            depth too.
        y_up: the source gave a negative fy: its poses are those of a camera whose y axis points up
            (ICL-NUIM), and have to be mirrored.
    """

    intrinsics: Intrinsics
    depth_scale: float | None = None
    y_up: bool = False
    scale_stated: bool = False

    def depth(self, default: float) -> DepthScale:
        """The scale of depth images; ``default`` units per metre are assumed where there is none."""
        units = self.depth_scale or default
        return DepthScale(units, units if self.scale_stated else 1.0, assumed=self.depth_scale is None)


def read_camera(path: Path) -> CameraSetup:
    """Read a camera.yaml: width height fx fy cx cy; optionally distortion (k1 k2 p1 p2 k3, or k4 k5 k6 as well),
    depth_scale and times: ``readout``, ``delay`` and ``depth_readout`` as in ``Intrinsics``, seconds.

    A negative fy is read as in ICL-NUIM: the images are upright all the same, so the camera gets its size, and
    ``y_up`` states that the poses are mirrored.

    Raises:
        DatasetError: the file cannot be read, or a key is missing, unknown or no usable number.
    """
    values = _load(path)
    if unknown := sorted(set(values) - {*_REQUIRED, *_OPTIONAL}):
        raise DatasetError(f"The camera file {path} has an unknown key '{unknown[0]}'.")
    if missing := [key for key in _REQUIRED if key not in values]:
        raise DatasetError(f"The camera file {path} lacks {', '.join(missing)}.")
    width, height, fx, fy, cx, cy = (_number(values, key, path) for key in _REQUIRED)
    if width != int(width) or height != int(height):
        raise DatasetError(f"The camera file {path} gives a size that is not whole: {width} x {height}.")
    depth_scale = _number(values, "depth_scale", path) if "depth_scale" in values else None
    if depth_scale is not None and depth_scale <= 0:
        raise DatasetError(f"The camera file {path} gives a depth_scale that is not positive: {depth_scale}.")
    distortion = _distortion(values.get("distortion"), path)
    times = {key: _number(values, key, path) for key in _TIMES if key in values}
    try:
        intrinsics = Intrinsics(int(width), int(height), fx, abs(fy), cx, cy, distortion, **times)
    except ConfigError as error:
        raise DatasetError(f"The camera file {path}: {error}") from error
    return CameraSetup(intrinsics, depth_scale, y_up=fy < 0, scale_stated=depth_scale is not None)


def write_camera(path: Path, intrinsics: Intrinsics, depth_scale: float | None) -> None:
    """Write a camera.yaml that ``read_camera`` understands.

    Args:
        path: the file.
        intrinsics: the camera.
        depth_scale: units of the depth images per metre; None = not stated.

    Raises:
        DatasetError: the file cannot be written.
    """
    values = {key: getattr(intrinsics, key) for key in _REQUIRED}
    values["distortion"] = list(intrinsics.distortion)
    values |= {} if depth_scale is None else {"depth_scale": depth_scale}
    values |= {key: getattr(intrinsics, key) for key in _TIMES if getattr(intrinsics, key) is not None}
    try:
        path.write_text(yaml.safe_dump(values, sort_keys=False, default_flow_style=None), encoding="utf-8")
    except OSError as error:
        raise DatasetError(f"The camera file {path} cannot be written: {error.strerror}.") from error


def _load(path: Path) -> dict[str, Any]:
    text = read_text(path, "The camera file", DatasetError, MAX_FILE_BYTES)
    try:
        values = load_yaml(text)
    except ConfigError as error:
        raise DatasetError(f"The camera file {path} is not YAML that can be used: {error}.") from error
    if not isinstance(values, dict):
        raise DatasetError(f"The camera file {path} must hold 'key: value' pairs such as 'fx: 525.0'.")
    return {str(key): value for key, value in values.items()}


def _number(values: dict[str, Any], key: str, path: Path) -> float:
    value = values[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < MAX_NUMBER:
        raise DatasetError(f"The camera file {path}: '{key}' must be a number, not {shortened(repr(value))}.")
    return float(value)


def _distortion(value: Any, path: Path) -> tuple[float, ...]:
    if value is None:
        return NO_DISTORTION
    if not isinstance(value, list) or len(value) not in COEFFICIENTS:
        raise DatasetError(f"The camera file {path}: 'distortion' must list k1 k2 p1 p2 k3, or k4 k5 k6 as well.")
    return tuple(_number({"distortion": item}, "distortion", path) for item in value)
