"""Fixtures that many tests use."""

import os
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

# Before numpy is imported, as the command line does: idle BLAS threads spin and slow the tests down.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import numpy as np
import pytest
from hypothesis import settings

from semslam.cli import main
from semslam.errors import DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import make_transform
from semslam.types import Frame, Trajectory

# How long an example takes depends on what else the machine does.
settings.register_profile("semslam", deadline=None)
settings.load_profile("semslam")

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder with real data beside the checkout; tests skip where it is absent."""
    if not (SHARED / "data").is_dir():
        pytest.skip(f"the real data is not here ({SHARED})")
    return SHARED


@dataclass(frozen=True)
class WallDataset:
    """A camera that slides along a poster 1.5 m away, 4 pixels a frame: poses are known exactly.

    Attributes:
        unreadable: frames that cannot be read.
        interrupt_at: frame whose reading is interrupted by Ctrl-C.
    """

    frames: int = 12
    unreadable: tuple[int, ...] = ()
    interrupt_at: int | None = None
    name: str = "wall"
    intrinsics: Intrinsics = field(default=Intrinsics(320, 240, 260.0, 260.0, 159.5, 119.5, readout=0.0))
    depth: float = 1.5
    step: int = 4

    @property
    def timestamps(self) -> list[float]:
        return [0.1 * i for i in range(self.frames)]

    @property
    def ground_truth(self) -> Trajectory:
        metres = self.step * self.depth / self.intrinsics.fx
        poses = np.stack([make_transform(np.eye(3), [metres * i, 0, 0]) for i in range(self.frames)])
        return Trajectory(np.array(self.timestamps), poses)

    @property
    def notes(self) -> list[str]:
        return []

    def __len__(self) -> int:
        return self.frames

    def frame(self, index: int) -> Frame:
        if index == self.interrupt_at:
            raise KeyboardInterrupt
        if index in self.unreadable:
            raise DatasetError(f"{index:06d}.png is truncated.")
        camera = self.intrinsics
        poster = _poster(camera.height, camera.width + self.step * self.frames)
        color = np.ascontiguousarray(poster[:, self.step * index : self.step * index + camera.width])
        depth = np.full((camera.height, camera.width), self.depth, dtype=np.float32)
        return Frame(index, self.timestamps[index], color, depth, camera)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(self.frames))


def _poster(height: int, width: int) -> np.ndarray:
    noise = np.random.default_rng(7).integers(0, 256, (height // 6 + 1, width // 6 + 1, 3), dtype=np.uint8)
    return cv2.resize(noise, (6 * noise.shape[1], 6 * noise.shape[0]), interpolation=cv2.INTER_NEAREST)[:height, :width]


@pytest.fixture
def wall() -> WallDataset:
    """A short sequence with exact poses."""
    return WallDataset()


EXAMPLE_PLUGIN = Path(__file__).resolve().parents[1] / "examples" / "plugin"


@pytest.fixture
def example_plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The name of the example's detector, which can be found as if the example were installed."""
    project = tomllib.loads((EXAMPLE_PLUGIN / "pyproject.toml").read_text())["project"]
    points = project["entry-points"]["semslam.detectors"]
    info = tmp_path / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    listed = "\n".join(f"{name} = {target}" for name, target in points.items())
    (info / "entry_points.txt").write_text(f"[semslam.detectors]\n{listed}\n")
    for folder in (tmp_path, EXAMPLE_PLUGIN):
        monkeypatch.syspath_prepend(str(folder))
    return next(iter(points))


@dataclass(frozen=True)
class Outcome:
    """What a command left on the screen, and its exit code."""

    code: int
    out: str
    err: str


Call = Callable[..., Outcome]


@pytest.fixture
def semslam(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """Run a command in this process."""

    def call(*arguments: object) -> Outcome:
        monkeypatch.setattr("sys.argv", ["semslam", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            main()
            raise SystemExit(0)
        code = stopped.value.code
        captured = capsys.readouterr()
        return Outcome(code if isinstance(code, int) else 1, captured.out, captured.err)

    return call
