"""Settings of datasets: which frames are read, how, and with which faults."""

from pathlib import Path

from pydantic import Field

from semslam.config.section import Section

Interval = tuple[float, float]


class FaultConfig(Section):
    """Faults put into a sequence on purpose; intervals are (from, to) in seconds since its first frame."""

    drop: float = Field(0.0, ge=0, lt=1, description="share of frames left out at random")
    unreadable: float = Field(0.0, ge=0, lt=1, description="share of frames whose image cannot be read, at random")
    gaps: tuple[Interval, ...] = Field((), description="intervals without any frame")
    black: tuple[Interval, ...] = Field((), description="intervals of black colour images")
    no_depth: tuple[Interval, ...] = Field((), description="intervals without a single depth value")
    nan_depth: tuple[Interval, ...] = Field((), description="intervals in which half of the depth values are NaN")
    blur: tuple[Interval, ...] = Field((), description="intervals of strong motion blur")
    frozen: tuple[Interval, ...] = Field((), description="intervals in which the image before them is repeated")
    seed: int = Field(0, ge=0, description="seed of what is drawn at random")


class DatasetConfig(Section):
    """Which frames are read, and how. What is set here wins over camera.yaml, which wins over the folder's name."""

    loader: str | None = Field(None, description="registered loader; none = guessed from the path")
    camera: Path | None = Field(None, description="camera.yaml used in place of the sequence's own")
    depth_scale: float | None = Field(None, gt=0, description="units of the depth images per metre")
    association_window: float = Field(0.02, gt=0, description="seconds between a colour image and its depth image")
    fps: float = Field(30.0, gt=0, description="frames per second, where the sequence has no time stamps")
    register_depth: bool = Field(True, description="7-Scenes: warp raw depth into the colour camera")
    color_topic: str | None = Field(None, description="ROS bag: topic of the colour images; none = guessed")
    depth_topic: str | None = Field(None, description="ROS bag: topic of the depth images; none = guessed")
    start: int = Field(0, ge=0, description="frames left out at the beginning")
    max_frames: int | None = Field(None, gt=0, description="frames read at the most")
    stride: int = Field(1, gt=0, description="every n-th frame is read")
    faults: FaultConfig = FaultConfig()
