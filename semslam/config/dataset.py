"""Settings of datasets: which frames are read, how, and with which faults."""

from pathlib import Path
from typing import Literal

from semslam.config.section import Section, setting

Interval = tuple[float, float]


class FaultConfig(Section):
    """Faults injected into a sequence; intervals are (from, to) in seconds since its first frame."""

    drop: float = setting(0.0, "share of frames dropped at random", ge=0, lt=1)
    unreadable: float = setting(0.0, "share of frames whose image cannot be read, at random", ge=0, lt=1)
    gaps: tuple[Interval, ...] = setting((), "intervals without frames", unit="s")
    black: tuple[Interval, ...] = setting((), "intervals of black colour images", unit="s")
    no_depth: tuple[Interval, ...] = setting((), "intervals without depth", unit="s")
    nan_depth: tuple[Interval, ...] = setting((), "intervals in which half of the depth values are NaN", unit="s")
    blur: tuple[Interval, ...] = setting((), "intervals of strong motion blur", unit="s")
    frozen: tuple[Interval, ...] = setting((), "intervals in which the image before them is repeated", unit="s")
    seed: int = setting(0, "seed of the random faults", ge=0)


class DatasetConfig(Section):
    """Which frames are read, and how. These settings override camera.yaml, which overrides the loader's defaults."""

    loader: str | None = setting(None, "registered loader; none = recognised by the layout")
    camera: Path | None = setting(None, "camera.yaml used instead of the sequence's own")
    depth_scale: float | None = setting(None, "units of the depth images per metre", gt=0)
    association_window: float = setting(0.02, "maximum time between a colour image and its depth image", unit="s", gt=0)
    fps: float = setting(30.0, "frames per second of a sequence without time stamps", gt=0)
    time_unit: Literal["s", "ms", "us", "ns"] | None = setting(
        None, "unit of the time stamps in lists, file names and ground truth; none = recognised"
    )
    register_depth: bool = setting(True, "7-Scenes: register raw depth to the colour camera")
    color_topic: str | None = setting(None, "ROS bag: topic of the colour images; none = chosen by role")
    depth_topic: str | None = setting(None, "ROS bag: topic of the depth images; none = chosen by role")
    camera_topic: str | None = setting(None, "ROS bag: topic of the CameraInfo; none = that of the colour images")
    start: int = setting(0, "frames skipped at the beginning", ge=0)
    max_frames: int | None = setting(None, "maximum number of frames", gt=0)
    stride: int = setting(1, "read every n-th frame", gt=0)
    faults: FaultConfig = FaultConfig()
