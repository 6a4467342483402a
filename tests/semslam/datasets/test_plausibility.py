"""Sequences that cannot be right are recognised without ground truth; sound ones are left alone."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semslam.datasets import Dataset, open_dataset
from semslam.datasets.plausibility import Concern, check_plausibility
from semslam.datasets.selection import ChosenFrames
from semslam.errors import DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.types import Frame

Change = Callable[[Frame], Frame]


class Changed(ChosenFrames):
    """A sequence whose frames are changed, or whose camera is another one."""

    def __init__(
        self, dataset: Dataset, change: Change = lambda frame: frame, camera: Intrinsics | None = None
    ) -> None:
        super().__init__(dataset, range(len(dataset)))
        self._change, self._camera = change, camera or dataset.intrinsics

    @property
    def intrinsics(self) -> Intrinsics:
        return self._camera

    def frame(self, index: int) -> Frame:
        return self._change(super().frame(index))


@pytest.fixture(scope="module")
def room() -> Dataset:
    return open_dataset("synthetic:room?width=320")


def concerns(dataset: Dataset) -> list[Concern]:
    found = check_plausibility(dataset)
    assert all(one.sentence.endswith(".") and np.isfinite(one.value) for one in found)
    return [one.concern for one in found]


def test_a_sound_sequence_raises_no_concern(room: Dataset) -> None:
    assert concerns(room) == []


def scaled(factor: float) -> Change:
    return lambda frame: replace(frame, depth=frame.depth * np.float32(factor))


def noisy(frame: Frame) -> Frame:
    rng = np.random.default_rng(frame.index)
    return replace(frame, depth=rng.uniform(0.5, 5, frame.depth.shape).astype(np.float32))


@pytest.mark.parametrize(
    ("change", "concern"),
    [
        (scaled(0.01), Concern.NEAR_DEPTH),
        (scaled(20.0), Concern.FAR_DEPTH),
        (scaled(0.0), Concern.NO_DEPTH),
        (noisy, Concern.NOISY_DEPTH),
        (lambda frame: replace(frame, color=np.zeros_like(frame.color)), Concern.BLANK_COLOR),
        (lambda frame: replace(frame, color=np.full_like(frame.color, 255)), Concern.BLANK_COLOR),
        (lambda frame: replace(frame, color=np.ascontiguousarray(frame.color[:, ::-1])), Concern.MIRRORED),
        (lambda frame: replace(frame, depth=np.ascontiguousarray(frame.depth[::-1])), Concern.MIRRORED),
        (lambda frame: replace(frame, depth=np.ascontiguousarray(frame.depth[::-1, ::-1])), Concern.MIRRORED),
    ],
)
def test_each_fault_is_recognised(room: Dataset, change: Change, concern: Concern) -> None:
    assert concerns(Changed(room, change)) == [concern]


@pytest.mark.parametrize(
    ("change", "concern"),
    [
        ({"fx": 4000.0}, Concern.FOCAL_LENGTH),
        ({"fy": 20.0}, Concern.FOCAL_LENGTH),
        ({"cx": -5.0}, Concern.PRINCIPAL_POINT),
        ({"cy": 1000.0}, Concern.PRINCIPAL_POINT),
    ],
)
def test_unusual_cameras_are_remarked_on(room: Dataset, change: dict[str, float], concern: Concern) -> None:
    camera = replace(room.intrinsics, **change)
    assert concerns(Changed(room, camera=camera)) == [concern]


def test_frames_that_cannot_be_read_are_passed_over(room: Dataset) -> None:
    def unreadable(frame: Frame) -> Frame:
        raise DatasetError("no")

    assert concerns(Changed(room, unreadable)) == []
    assert check_plausibility(room, []) == ()
    assert check_plausibility(room, [3]) == ()


@pytest.mark.parametrize("name", ["redkitchen", "rgbd_dataset_freiburg1_rpy_first10s"])
def test_real_sequences_raise_no_concern_unless_they_are_mirrored(shared: Path, name: str) -> None:
    dataset = open_dataset(shared / "data" / name)
    assert concerns(dataset) == []
    mirrored = Changed(dataset, lambda frame: replace(frame, color=np.ascontiguousarray(frame.color[:, ::-1])))
    assert concerns(mirrored) == [Concern.MIRRORED]
