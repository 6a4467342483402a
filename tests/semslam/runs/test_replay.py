"""Detection, verification and back end repeated on a saved front end."""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.datasets.camera_times import CameraTimes
from semslam.errors import ConfigError, DatasetError, ResultsError
from semslam.geometry.se3 import exp_so3, make_transform
from semslam.runs.manifest import seal
from semslam.runs.pipeline import replay, run
from semslam.runs.recording import (
    RecordedFrame,
    Recording,
    SavedFrontEnd,
    read_front_end,
    read_recording,
    write_recording,
)
from semslam.runs.results import write_run
from semslam.types import Frame, Motion, Observations, TrackingStatus
from tests.conftest import Call, WallDataset

ALONE = Config(detector="none")
SCENE = "synthetic:room?frames=8&width=160"
SECONDS = st.floats(0, 0.1)
SAME = ("trajectory.txt", "odometry.txt", "keyframes.txt", "loops.jsonl", "graph.g2o", "frontend.npz", "config.yaml")


@dataclass(frozen=True)
class CountingWall(WallDataset):
    """Remembers which frames were read."""

    read: tuple[list[int], ...] = ([],)

    def frame(self, index: int) -> Frame:
        self.read[0].append(index)
        return super().frame(index)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short run that the command line can replay."""
    dataset = open_dataset(SCENE)
    directory = tmp_path_factory.mktemp("runs") / "first"
    write_run(run(dataset, ALONE), dataset, directory, plots=False, source=SCENE)
    return directory


def test_a_replay_gives_the_same_bytes(wall: WallDataset, tmp_path: Path) -> None:
    config = Config(detector="thumbnail").with_changes(
        loops={"min_gap": 0.3, "min_score": 0.0}, keyframes={"interval": 0.2}
    )
    first = run(replace(wall, unreadable=(5,)), config)
    write_run(first, wall, tmp_path / "first", plots=False)
    again = replay(wall, read_front_end(tmp_path / "first").recording, config)
    write_run(again, wall, tmp_path / "again", plots=False)
    assert first.metrics.loops.accepted > 2
    assert first.metrics.model_copy(update={"time": again.metrics.time}) == again.metrics
    for name in SAME:
        assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "first" / name).read_bytes(), name


def test_a_replay_with_other_settings_keeps_the_odometry(semslam: Call, saved: Path, tmp_path: Path) -> None:
    outcome = semslam("run", "--from", saved, "--set", "backend.robust=dcs", "--out", tmp_path / "alone", "--no-plots")
    assert outcome.code == 0, outcome.err
    for name in ("odometry.txt", "frontend.npz", "keyframes.csv"):
        assert (tmp_path / "alone" / name).read_bytes() == (saved / name).read_bytes(), name
    assert "robust: dcs" in (tmp_path / "alone" / "config.yaml").read_text()


def test_images_are_read_at_keyframes_alone(wall: WallDataset) -> None:
    recording = run(wall, ALONE).recording
    counting = CountingWall(read=([],))
    result = replay(counting, recording, ALONE)
    keyframes = [keyframe.frame_index for keyframe in result.slam.keyframes]
    assert 1 < len(keyframes) < len(wall)
    assert counting.read[0] == [0, *keyframes], "the first once more, to know the sequence again"


def test_an_interrupted_run_is_replayed_as_far_as_it_went(wall: WallDataset) -> None:
    first = run(replace(wall, unreadable=(2,), interrupt_at=9), ALONE)
    again = replay(wall, first.recording, ALONE)
    np.testing.assert_array_equal(again.trajectory.poses, first.trajectory.poses)
    assert again.metrics.interrupted
    assert (again.metrics.frames, again.metrics.unreadable) == (9, 1)


def test_an_interrupted_or_older_run_is_replayed_with_a_remark(semslam: Call, saved: Path, tmp_path: Path) -> None:
    older = tmp_path / "older"
    shutil.copytree(saved, older)
    with np.load(saved / "frontend.npz") as file:
        np.savez(older / "frontend.npz", **dict(file) | {"interrupted": np.array(True)})
    settings_file = older / "config.yaml"
    settings_file.write_text(settings_file.read_text() + "forgotten: 1\n")
    _reseal(older)
    outcome = semslam("run", "--from", older, "--set", "backend.robust=dcs", "--out", tmp_path / "again", "--no-plots")
    assert outcome.code == 0
    assert "was interrupted; its 8 frames of 8 were used" in outcome.err
    assert "left out, being no settings now: forgotten." in outcome.err
    assert "robust: dcs" in (tmp_path / "again" / "config.yaml").read_text()


def test_another_sequence_is_refused(wall: WallDataset) -> None:
    recording = run(wall, ALONE).recording
    for other in (replace(wall, frames=8), replace(wall, depth=1.6)):
        with pytest.raises(DatasetError, match="not the sequence of the saved run"):
            replay(other, recording, ALONE)


@pytest.mark.parametrize(
    ("decisive", "changes"),
    [
        ("odometry", {"odometry": "dense"}),
        ("dataset", {"dataset": {"stride": 2}}),
        ("keyframes.interval", {"keyframes": {"interval": 1}}),
        ("feature_map", {"feature_map": {"readout": 0.0}}),
        ("keypoints", {"keypoints": {"count": 500}}),
        ("seed", {"seed": 3}),
        ("plugins.feature_map", {"plugins": {"feature_map": {"anything": 1}}}),
    ],
)
def test_settings_that_the_odometry_reads_cannot_change(
    wall: WallDataset, decisive: str, changes: dict[str, object]
) -> None:
    saved = SavedFrontEnd(ALONE, run(wall, ALONE).recording, None)
    with pytest.raises(ConfigError, match=f"'{decisive}' decides the odometry"):
        saved.check_settings(ALONE.with_changes(**changes))


def test_settings_that_the_odometry_does_not_read_may_change(wall: WallDataset) -> None:
    saved = SavedFrontEnd(ALONE, run(wall, ALONE).recording, None)
    others = {"dense": {"max_depth": 3.0}, "plugins": {"mine": {"bins": 4}}, "keyframes": {"cloud_voxel": 0.1}}
    saved.check_settings(ALONE.with_changes(detector="fused", **others))
    kiss = ALONE.with_changes(odometry="kiss")
    SavedFrontEnd(kiss, saved.recording, None).check_settings(kiss.with_changes(seed=3, keypoints={"count": 500}))


def test_what_cannot_be_replayed_is_one_sentence(semslam: Call, saved: Path, tmp_path: Path) -> None:
    damaged, nameless = tmp_path / "damaged", tmp_path / "nameless"
    shutil.copytree(saved, damaged)
    content = (saved / "frontend.npz").read_bytes()
    (damaged / "frontend.npz").write_bytes(content[: len(content) // 2])
    shutil.copytree(saved, nameless)
    (nameless / "sequence.txt").unlink()
    _reseal(nameless)
    other = tmp_path / "settings.yaml"
    other.write_text("seed: 1\n")
    for words, complaint in (
        (("--from", tmp_path), "no run folder"),
        (("--from", damaged), "is damaged"),
        (("--from", nameless), "does not tell where its images are"),
        (("--from", saved, "--odometry", "dense"), "'odometry' decides the odometry"),
        (("--from", saved, "--config", other), "change them with --set"),
        (("--from", saved, "synthetic:house?frames=30&width=160"), "not the sequence"),
        ((), "Name a sequence"),
    ):
        outcome = semslam("run", *words, "--out", tmp_path / "out", "--no-plots")
        assert (outcome.code, len(outcome.err.strip().splitlines())) == (2, 1), outcome.err
        assert complaint in outcome.err
    assert not (tmp_path / "out").exists()


@settings(max_examples=25)
@given(
    data=st.data(),
    count=st.integers(1, 6),
    unreadable=st.lists(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20), max_size=3),
)
def test_a_recording_reads_back(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, count: int, unreadable: list[str]
) -> None:
    directory = tmp_path_factory.mktemp("recording")
    (directory / "config.yaml").write_text(ALONE.dump())
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    frames = tuple(_frame(index, data.draw(st.none() | st.integers(0, 4)), rng) for index in range(count))
    times = data.draw(st.none() | st.builds(CameraTimes, SECONDS, SECONDS, st.none() | SECONDS))
    recording = Recording(frames, tuple(unreadable), interrupted=True, checksum=2**32 - 1, times=times)
    write_recording(directory, recording, str(directory))
    seal(directory, "{}")
    front_end = read_front_end(directory)
    read = front_end.recording
    assert front_end.source == str(directory)
    assert (read.unreadable, read.interrupted, read.checksum) == (recording.unreadable, True, 2**32 - 1)
    assert read.times == times
    for before, after in zip(frames, read.frames, strict=True):
        assert (before.index, before.timestamp) == (after.index, after.timestamp)
        one, other = before.motion, after.motion
        assert (one.status, one.map_id, one.inliers) == (other.status, other.map_id, other.inliers)
        np.testing.assert_array_equal(one.T_prev_cur, other.T_prev_cur)
        np.testing.assert_array_equal(one.covariance, other.covariance)
        assert (one.observations is None) == (other.observations is None)
        if one.observations is not None and other.observations is not None:
            for field in ("landmarks", "pixels", "depths"):
                np.testing.assert_array_equal(getattr(one.observations, field), getattr(other.observations, field))


@pytest.mark.parametrize("name", ["T_prev_cur", "covariance", "timestamp", "landmarks", "status", "checksum", "times"])
def test_a_damaged_recording_is_named(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(0)
    frames = tuple(_frame(index, 3, rng) for index in range(3))
    write_recording(tmp_path, Recording(frames, (), False, checksum=1, times=CameraTimes(0.026, 0.0, None)))
    with np.load(tmp_path / "frontend.npz") as file:
        arrays = dict(file)
    damaged = arrays[name].astype(np.float64) * np.nan if name != "status" else np.array(["ok", "fine", "ok"])
    if name == "landmarks":
        damaged = arrays[name][1:]
    if name == "checksum":
        damaged = np.array(np.inf)
    np.savez(tmp_path / "frontend.npz", **arrays | {name: damaged})
    with pytest.raises(ResultsError, match="is damaged"):
        read_recording(tmp_path)


def test_a_recording_from_before_cameras_times_were_kept_is_read(tmp_path: Path) -> None:
    frames = tuple(_frame(index, 3, np.random.default_rng(0)) for index in range(3))
    write_recording(tmp_path, Recording(frames, (), False, checksum=1, times=CameraTimes(0.026, 0.0, None)))
    with np.load(tmp_path / "frontend.npz") as file:
        arrays = {name: array for name, array in file.items() if name != "times"}
    np.savez(tmp_path / "frontend.npz", **arrays)
    assert read_recording(tmp_path).times is None


def test_a_recording_of_another_version_is_named(tmp_path: Path) -> None:
    frames = tuple(_frame(index, 3, np.random.default_rng(0)) for index in range(3))
    write_recording(tmp_path, Recording(frames, (), interrupted=False, checksum=1))
    with np.load(tmp_path / "frontend.npz") as file:
        arrays = dict(file)
    del arrays["depths"]
    np.savez(tmp_path / "frontend.npz", **arrays)
    with pytest.raises(ResultsError, match="written by another version"):
        read_recording(tmp_path)


def _frame(index: int, seen: int | None, rng: np.random.Generator) -> RecordedFrame:
    observations = None
    if seen is not None:
        pixels = rng.normal(size=(seen, 2)).astype(np.float32)
        observations = Observations(rng.integers(0, 99, seen), pixels, rng.random(seen).astype(np.float32))
    T = make_transform(exp_so3(rng.normal(size=3)), rng.normal(size=3))
    status = list(TrackingStatus)[int(rng.integers(len(TrackingStatus)))]
    return RecordedFrame(2 * index, 0.1 * index, Motion(T, np.eye(6) * rng.random(), status, index, 7, observations))


def _reseal(directory: Path) -> None:
    """Make the manifest that a run with these files would have."""
    metrics = (directory / "metrics.json").read_text()
    for name in ("metrics.json", "manifest.json"):
        (directory / name).unlink()
    seal(directory, metrics)
