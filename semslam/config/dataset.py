"""Settings of datasets: which frames are read, how, and with which faults."""

from pathlib import Path
from typing import Literal

from semslam.config.faults import FaultConfig
from semslam.config.section import Section, setting


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
    register_depth: bool = setting(True, "7-Scenes, RealSense recordings: register raw depth to the colour camera")
    color_topic: str | None = setting(None, "ROS bag: topic of the colour images; none = chosen by role")
    depth_topic: str | None = setting(None, "ROS bag: topic of the depth images; none = chosen by role")
    camera_topic: str | None = setting(None, "ROS bag: topic of the CameraInfo; none = that of the colour images")
    cache_dir: Path | None = setting(
        None, "folder that stores the frames of rendered scenes once they are made; none = made whenever they are read"
    )
    start: int = setting(0, "frames skipped at the beginning", ge=0)
    max_frames: int | None = setting(None, "maximum number of frames", gt=0)
    stride: int = setting(1, "read every n-th frame", gt=0)
    faults: FaultConfig = FaultConfig()
