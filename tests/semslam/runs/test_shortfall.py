"""A run that tracks next to nothing says why and has an exit code of its own."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from semslam.config import Config
from semslam.runs.pipeline import run
from semslam.runs.shortfall import shortfall
from semslam.types import Frame
from tests.conftest import Call, WallDataset


@dataclass(frozen=True)
class BlackWall(WallDataset):
    """The camera's cover is on."""

    def frame(self, index: int) -> Frame:
        frame = super().frame(index)
        return replace(frame, color=np.zeros_like(frame.color))


@dataclass(frozen=True)
class BlindWall(WallDataset):
    """The depth images hold nothing."""

    def frame(self, index: int) -> Frame:
        frame = super().frame(index)
        return replace(frame, depth=np.zeros_like(frame.depth))


@pytest.mark.parametrize(
    ("dataset", "why"), [(BlackWall(frames=30), "keypoints each, as black"), (BlindWall(frames=30), "have a depth")]
)
def test_the_reason_is_named(dataset: WallDataset, why: str) -> None:
    result = run(dataset, Config(detector="none"))
    sentence = shortfall(result.metrics, result.slam.keyframes)
    assert sentence is not None
    assert why in sentence


def test_a_tracked_run_has_no_shortfall(wall: WallDataset) -> None:
    result = run(wall, Config(detector="none"))
    assert shortfall(result.metrics, result.slam.keyframes) is None


def test_the_command_ends_with_its_own_code(semslam: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("semslam.datasets.open_dataset", lambda *_, **__: BlackWall(frames=30))
    outcome = semslam("run", "wall", "--detector", "none", "--no-plots", "--out", tmp_path / "run")
    assert outcome.code == 3
    assert "Only 1 of 30 frames were tracked" in outcome.err
    assert (tmp_path / "run" / "metrics.json").is_file()
