"""Rendered scenes as a dataset: ``synthetic:house?seed=1&light=dim``."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Self
from urllib.parse import parse_qsl

import numpy as np
import numpy.typing as npt

from semslam.config import DatasetConfig
from semslam.datasets.synthetic.path import Walk, walk
from semslam.datasets.synthetic.renderer import Lighting, Renderer, View
from semslam.datasets.synthetic.scene import Scene
from semslam.datasets.synthetic.scenes import make_house, make_twins
from semslam.datasets.synthetic.sensor import sense_color, sense_depth
from semslam.errors import DatasetError
from semslam.types import Frame, Intrinsics, Trajectory

SCENES: dict[str, Callable[[int, bool], Scene]] = {"house": make_house, "twins": make_twins}
LIGHTS = {
    "same": Lighting(),
    "dim": Lighting(day=0.35, lamps=0.3),
    "bright": Lighting(day=1.5, lamps=0.8),
    "evening": Lighting(day=0.05, lamps=1.0, tint=(1.1, 1.0, 0.8)),
    "cool": Lighting(tint=(0.82, 0.95, 1.15)),
}
FIELD_OF_VIEW = 262.5 / 320.0
"""Focal length as a share of the image's width, as a Kinect's."""


@dataclass(frozen=True, slots=True)
class Request:
    """What may stand behind the question mark.

    Attributes:
        seed: of textures, sway and noise.
        frames: frames at the most; 0 = the whole way.
        rate: frames a second.
        width: pixels; the height is three quarters of it.
        light: light of the second pass, one of ``LIGHTS``.
        offset: metres by which the second pass keeps to the right of the first.
        moved: 1 = objects moved or missing on the second pass.
        noise: 0 = a perfect sensor.
    """

    seed: int = 0
    frames: int = 0
    rate: float = 10.0
    width: int = 320
    light: str = "same"
    offset: float = 0.0
    moved: int = 0
    noise: int = 1


class SyntheticDataset:
    """A rendered sequence; frames are made when they are read, poses and depth are exact but for the sensor.

    Args:
        scene: "house" (four rooms and a corridor) or "twins" (two rooms that look alike).
        request: switches.

    Raises:
        DatasetError: the scene or a switch is unknown.
    """

    layout: ClassVar[str] = "synthetic:SCENE"

    def __init__(self, scene: str, request: Request) -> None:
        if scene not in SCENES:
            raise DatasetError(f"There is no synthetic scene '{scene}'. Known: {', '.join(SCENES)}.")
        if request.light not in LIGHTS:
            raise DatasetError(f"There is no light '{request.light}'. Known: {', '.join(LIGHTS)}.")
        if request.rate <= 0 or request.width < 64 or request.width % 4 or request.frames < 0 or request.seed < 0:
            raise DatasetError(f"These figures are not usable for a synthetic scene: {request}.")
        self._make = SCENES[scene]
        self._request = request
        self.name = f"synthetic-{scene}"

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Recognise no path: scenes are named, not found."""
        return False

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """Take ``synthetic:SCENE?key=value&...``; the keys are those of ``Request``."""
        scene, _, query = str(path).partition(":")[2].partition("?")
        kinds = {field.name: type(field.default) for field in fields(Request)}
        values: dict[str, int | float | str] = {}
        for key, text in parse_qsl(query, keep_blank_values=True):
            if key not in kinds:
                raise DatasetError(f"A synthetic scene has no switch '{key}'. Known: {', '.join(kinds)}.")
            try:
                values[key] = kinds[key](text)
            except ValueError as error:
                raise DatasetError(f"The switch {key} of a synthetic scene cannot be '{text}'.") from error
        return cls(scene or "house", Request(**values))  # type: ignore[arg-type]

    @property
    def intrinsics(self) -> Intrinsics:
        """A Kinect-like pinhole without distortion."""
        width, height = self._request.width, self._request.width * 3 // 4
        focal = FIELD_OF_VIEW * width
        return Intrinsics(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)

    @cached_property
    def timestamps(self) -> list[float]:
        """Seconds from 0."""
        return [float(t) for t in self._walk.timestamps]

    @cached_property
    def ground_truth(self) -> Trajectory:
        """Exact poses; the world's z points up."""
        return Trajectory(self._walk.timestamps, self._walk.poses)

    @property
    def notes(self) -> list[str]:
        """Nothing is mended here."""
        return []

    def __len__(self) -> int:
        return len(self._walk.timestamps)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))

    def frame(self, index: int) -> Frame:
        """Render one frame as the sensor sees it."""
        view = self.view(index)
        if self._request.noise:
            rng = np.random.default_rng([self._request.seed, 2, index])
            color, depth = sense_color(view.color, rng), sense_depth(view, rng)
        else:
            color, depth = np.clip(np.rint(view.color), 0, 255).astype(np.uint8), view.depth
        return Frame(index, self.timestamps[index], color, depth, self.intrinsics)

    def labels(self, index: int) -> npt.NDArray[np.uint8]:
        """Exact NYU40 labels (H, W) of a frame; 0 where nothing is."""
        return self.view(index).labels

    def view(self, index: int) -> View:
        """What a perfect camera sees in a frame."""
        second = bool(self._walk.second[index])
        renderer = self._second_renderer if second and self._request.moved else self._first_renderer
        lighting = LIGHTS[self._request.light] if second else LIGHTS["same"]
        return renderer.render(self._walk.poses[index], self.intrinsics, lighting)

    @cached_property
    def _first_renderer(self) -> Renderer:
        return Renderer(self._make(self._request.seed, False))

    @cached_property
    def _second_renderer(self) -> Renderer:
        return Renderer(self._make(self._request.seed, True))

    @cached_property
    def _walk(self) -> Walk:
        request = self._request
        whole = walk(self._make(request.seed, False), request.rate, request.seed, request.offset)
        kept = slice(0, request.frames or None)
        return Walk(whole.timestamps[kept], whole.poses[kept], whole.second[kept])
