"""Rendered scenes as a dataset: ``synthetic:house?seed=1&light=dim``."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import ClassVar, Literal, Self
from urllib.parse import parse_qsl

import numpy as np
import numpy.typing as npt
from pydantic import Field, ValidationError, field_validator

from semslam.config import DatasetConfig, Section
from semslam.datasets.synthetic.cache import FrameCache
from semslam.datasets.synthetic.path import Walk, Way
from semslam.datasets.synthetic.renderer import Lighting, Renderer, View
from semslam.datasets.synthetic.scenes import PLANS
from semslam.datasets.synthetic.sensor import DEPTH_SENSORS, sense_color
from semslam.datasets.synthetic.shapes import Part
from semslam.datasets.synthetic.walkers import DISTANCES, Walkers, parts_of, persons
from semslam.errors import DatasetError
from semslam.geometry.se3 import Transform, Transforms
from semslam.types import Frame, Intrinsics, Trajectory

LIGHTS = {
    "same": Lighting(),
    "dim": Lighting(day=0.35, lamps=0.3),
    "bright": Lighting(day=1.5, lamps=0.8),
    "evening": Lighting(day=0.05, lamps=1.0, tint=(1.1, 1.0, 0.8)),
    "cool": Lighting(tint=(0.82, 0.95, 1.15)),
}
FIELD_OF_VIEW = 262.5 / 320.0
"""Focal length as a share of the image's width, as a Kinect's."""


class Request(Section):
    """What may stand behind the question mark."""

    seed: int = Field(0, ge=0, description="seed of textures, small things, sway and noise")
    hand: int | None = Field(None, ge=0, description="seed of sway and noise where it is another: a walk of its own")
    frames: int = Field(0, ge=0, description="maximum number of frames; 0 = the whole way")
    rate: float = Field(10.0, gt=0, le=1000, description="frames a second")
    width: int = Field(320, ge=64, le=4096, multiple_of=4, description="pixels; the height is three quarters of it")
    way: Literal["again", "back"] = Field("again", description="whether the second pass repeats the first or goes back")
    light: str = Field("same", description="light of the second pass: " + ", ".join(LIGHTS))
    offset: float = Field(0.0, ge=-1, le=1, description="metres that the second pass keeps to the right of the first")
    moved: bool = Field(False, description="objects moved or missing on the second pass")
    people: int = Field(0, ge=0, le=len(DISTANCES), description="persons who walk to and fro in front of the camera")
    noise: bool = Field(True, description="whether the sensor has noise and holes")
    sensor: str = Field("structured", description="what measures depth: " + ", ".join(DEPTH_SENSORS))
    sway: float = Field(1.0, ge=0, le=20, description="factor on the hand's sway")
    readout: float = Field(0.0, ge=0, le=0.1, description="seconds from colour's first row to its last")
    depth_readout: float = Field(0.0, ge=0, le=0.1, description="seconds from depth's first row to its last")
    delay: float = Field(0.0, ge=-0.1, le=0.1, description="seconds by which depth is taken after colour")
    depth_factor: float = Field(1.0, ge=0.5, le=2, description="measured depth divided by the true one")
    stated: bool = Field(True, description="whether the camera states its timing")

    @field_validator("light")
    @classmethod
    def _is_known(cls, light: str) -> str:
        if light not in LIGHTS:
            raise ValueError(f"'{light}' is none of {', '.join(LIGHTS)}")
        return light

    @field_validator("sensor")
    @classmethod
    def _is_a_sensor(cls, sensor: str) -> str:
        if sensor not in DEPTH_SENSORS:
            raise ValueError(f"'{sensor}' is none of {', '.join(DEPTH_SENSORS)}")
        return sensor

    @property
    def hand_seed(self) -> int:
        """Seed of sway and noise."""
        return self.seed if self.hand is None else self.hand

    @classmethod
    def parse(cls, query: str) -> Self:
        """Read ``key=value&key=value``.

        Raises:
            DatasetError: a key is unknown, or a value out of its range.
        """
        values = dict(parse_qsl(query, keep_blank_values=True))
        if unknown := sorted(set(values) - set(cls.model_fields)):
            raise DatasetError(f"Synthetic scenes have no switch '{unknown[0]}'. Known: {', '.join(cls.model_fields)}.")
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            first = error.errors()[0]
            raise DatasetError(f"The switch '{first['loc'][0]}' of a synthetic scene: {first['msg']}.") from error


class SyntheticDataset:
    """A rendered sequence; frames are made when they are read, poses and depth are exact but for the sensor.

    Args:
        scene: "house" (four rooms and a corridor), "twins" (two rooms that look alike) or "room".
        request: switches.
        cache: folder that stores frames once they are rendered; None = rendered whenever they are read.

    Raises:
        DatasetError: the scene is unknown.
    """

    layout: ClassVar[str] = "synthetic:SCENE"
    reads: ClassVar[tuple[str, ...]] = ()

    def __init__(self, scene: str, request: Request, cache: Path | None = None) -> None:
        if scene not in PLANS:
            raise DatasetError(f"There is no synthetic scene '{scene}'. Known: {', '.join(PLANS)}.")
        self._scene = scene
        self._request = request
        self.name = f"synthetic-{scene}"
        switches = request.model_copy(update={"frames": 0}).model_dump_json()  # fewer frames are the same frames
        self._cache = None if cache is None else FrameCache(cache, scene, switches)

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Recognise no path: scenes are named, not found."""
        return False

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """Take ``synthetic:SCENE?key=value&...``; the keys are those of ``Request``, the scene is "house" if left out.

        Raises:
            DatasetError: the scene or a switch is unknown, or a value out of its range.
        """
        scene, _, query = str(path).partition(":")[2].partition("?")
        return cls(scene or "house", Request.parse(query), config.cache_dir)

    @property
    def intrinsics(self) -> Intrinsics:
        """A Kinect-like pinhole without distortion."""
        width, height = self._request.width, self._request.width * 3 // 4
        focal = FIELD_OF_VIEW * width
        camera = Intrinsics(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)
        request = self._request
        if not request.stated:
            return camera
        return replace(camera, readout=request.readout, delay=request.delay, depth_readout=request.depth_readout)

    @cached_property
    def timestamps(self) -> list[float]:
        """Seconds from 0."""
        return [float(t) for t in self._walk.timestamps]

    @property
    def second_pass(self) -> npt.NDArray[np.bool_]:
        """Whether each frame belongs to the second pass, (N,)."""
        return self._walk.second

    @cached_property
    def ground_truth(self) -> Trajectory:
        """Exact poses at the instant of colour's middle row; the world's z points up."""
        return Trajectory(self._walk.timestamps, self._walk.poses)

    @property
    def notes(self) -> list[str]:
        """Nothing is corrected here."""
        return []

    def __len__(self) -> int:
        return len(self._walk.timestamps)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))

    def frame(self, index: int) -> Frame:
        """A frame as the sensor sees it: rendered, or read from the cache.

        Raises:
            IndexError: there is no such frame.
        """
        if self._cache is None or not 0 <= index < len(self):
            return self._rendered(index)
        frame = self._cache.read(index, self.timestamps[index], self.intrinsics)
        if frame is None:
            frame = self._rendered(index)
            self._cache.write(frame)
        return frame

    def _rendered(self, index: int) -> Frame:
        view = self.view(index)
        if self._request.noise:
            rng = np.random.default_rng([self._request.hand_seed, 2, index])
            sense_depth = DEPTH_SENSORS[self._request.sensor]
            color, depth = sense_color(view.color, rng), sense_depth(view, self.intrinsics.fx, rng)
        else:
            color, depth = np.clip(np.rint(view.color), 0, 255).astype(np.uint8), view.depth
        if self._request.depth_factor != 1:
            depth = depth * np.float32(self._request.depth_factor)
        return Frame(index, self.timestamps[index], color, depth, self.intrinsics)

    def labels(self, index: int) -> npt.NDArray[np.uint8]:
        """Exact NYU40 labels (H, W) of a frame; 0 where nothing is."""
        return self.view(index).labels

    def view(self, index: int) -> View:
        """What a camera without noise sees in a frame: colour and labels in colour's instants, depth in its own.

        Raises:
            IndexError: there is no such frame.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"There is no frame {index}: the sequence has {len(self)}.")
        second = bool(self._walk.second[index])
        request, camera, time = self._request, self.intrinsics, float(self._walk.timestamps[index])
        renderer = _renderer(self._scene, request.seed, bool(second and request.moved), request.people)
        lighting = LIGHTS[request.light] if second else LIGHTS["same"]
        people = self._walkers.vertices(time) if request.people else None
        seen = renderer.render(self._poses(index, request.readout, 0.0), camera, lighting, people)
        if not request.delay and request.depth_readout == request.readout:
            return seen
        people = self._walkers.vertices(time + request.delay) if request.people else None
        depth, cosine = renderer.measure(self._poses(index, request.depth_readout, request.delay), camera, people)
        return replace(seen, depth=depth, cosine=cosine)

    def _poses(self, index: int, readout: float, delay: float) -> Transform | Transforms:
        """Pose of a frame (4, 4), or of each of its rows (H, 4, 4) where they are not of one instant."""
        if not readout and not delay:
            return np.asarray(self._walk.poses[index])
        camera = self.intrinsics
        rows = (np.arange(camera.height) - camera.cy) / camera.height
        return self._way.poses(self._walk.timestamps[index] + delay + readout * rows)

    def surfaces(self, moved: bool) -> Sequence[Part]:
        """What stands in the scene, before or after things were moved."""
        return PLANS[self._scene].build(self._request.seed, moved).parts

    @property
    def rooms(self) -> npt.NDArray[np.int64]:
        """Which of the scene's rooms each frame's camera stands in, (N,); -1 for none."""
        x, y = self._walk.poses[:, 0, 3], self._walk.poses[:, 1, 3]
        rooms = np.full(len(x), -1, dtype=np.int64)
        for number, (x0, y0, x1, y1) in enumerate(PLANS[self._scene].rooms):
            rooms[(x >= x0) & (x < x1) & (y >= y0) & (y < y1)] = number
        return rooms

    @cached_property
    def _way(self) -> Way:
        request, plan = self._request, PLANS[self._scene]
        route = plan.back if request.way == "back" else plan.route
        return Way(route, request.hand_seed, request.offset, request.sway)

    @cached_property
    def _walkers(self) -> Walkers:
        return Walkers(persons(self._request.people), self._way, self._way.seconds)

    @cached_property
    def _walk(self) -> Walk:
        whole = self._way.walk(self._request.rate)
        kept = slice(0, self._request.frames or None)
        return Walk(whole.timestamps[kept], whole.poses[kept], whole.second[kept])


@lru_cache(maxsize=4)
def _renderer(scene: str, seed: int, moved: bool, people: int) -> Renderer:
    """A scene ready to be rendered; kept, since its light takes seconds to bake."""
    return Renderer(PLANS[scene].build(seed, moved, parts_of(persons(people))))
