"""Runs shown in Rerun: the recording is read back."""

import shutil
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.runs.pipeline import replay, run
from semslam.runs.results import write_run
from semslam.runtime.workers import WorkerKind
from semslam.viewers import rerun_viewer
from semslam.viewers.background import BackgroundViewer
from semslam.viewers.rerun_stream import open_viewer
from tests.conftest import Call, WallDataset

pytest.importorskip("rerun", reason="the extra 'rerun' is not installed")
SCENE = "synthetic:room?frames=30&width=160&noise=0"
OPTIONS = ("--detector", "semantic", "--set", "loops.min_gap=1.0", "--no-plots")


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short run."""
    dataset = open_dataset(SCENE)
    directory = tmp_path_factory.mktemp("runs") / "room"
    write_run(run(dataset, Config(detector="thumbnail")), dataset, directory, plots=False, source=SCENE)
    return directory


def _rows(file: Path) -> Counter[str]:
    """Rows of each entity in a recording."""
    from rerun.chunk import RrdReader

    reader = RrdReader(file)
    assert len(reader.recordings()) == 1
    assert len(reader.blueprints()) == 1
    rows: Counter[str] = Counter()
    for chunk in reader.store().stream():
        rows[str(chunk.entity_path)] += chunk.num_rows
    return rows


def test_a_run_is_recorded_frame_by_frame(semslam: Call, tmp_path: Path) -> None:
    outcome = semslam("run", SCENE, *OPTIONS, "--rerun", tmp_path / "run.rrd", "--out", tmp_path / "run")
    assert outcome.code == 0, outcome.err
    rows = _rows(tmp_path / "run.rrd")
    keyframes = len((tmp_path / "run" / "keyframes.csv").read_text().splitlines()) - 1
    assert rows["/world/live/camera"] == rows["/tracking/inliers"] == 30
    assert 15 <= rows["/world/live/camera/image/color"] < 30, "ten frames a second, five images and the keyframes'"
    assert keyframes - 1 <= rows["/world/live/path"] == rows["/world/live/odometry"] <= keyframes + 1
    for name in ("camera/image/depth", "camera/image/labels", "camera/image/nodes", "nodes", "cloud", "landmarks"):
        # The first keyframe has no landmarks yet.
        assert keyframes - (name == "landmarks") <= rows[f"/world/live/{name}"] <= keyframes, name
    for name in ("trajectory", "ground_truth", "keyframes", "map", "loops/accepted", "loops/rejected"):
        assert rows[f"/world/final/{name}"] == 1, name


def test_a_viewer_changes_nothing(semslam: Call, tmp_path: Path) -> None:
    semslam("run", SCENE, *OPTIONS, "--rerun", tmp_path / "run.rrd", "--out", tmp_path / "shown")
    semslam("run", SCENE, *OPTIONS, "--out", tmp_path / "alone")
    for name in ("trajectory.txt", "loops.jsonl", "graph.g2o", "map.ply", "config.yaml"):
        assert (tmp_path / "shown" / name).read_bytes() == (tmp_path / "alone" / name).read_bytes(), name


def test_a_saved_run_is_shown_again(semslam: Call, saved: Path, tmp_path: Path) -> None:
    outcome = semslam("view", saved, "--save", tmp_path / "new" / "view.rrd")
    assert outcome.code == 0, outcome.err
    rows = _rows(tmp_path / "new" / "view.rrd")
    assert rows["/world/live/camera"] == 30
    assert 0 < rows["/world/live/camera/image/labels"] < 30
    assert rows["/world/final/map"] == 1


def test_the_semantic_map_is_shown_where_there_is_one(semslam: Call, saved: Path, tmp_path: Path) -> None:
    labelled = shutil.copytree(saved, tmp_path / "labelled")
    assert semslam("map", labelled, "--semantic", "--voxel", 0.08).code == 0
    outcome = semslam("view", labelled, "--save", tmp_path / "view.rrd")
    assert outcome.code == 0, outcome.err
    rows = _rows(tmp_path / "view.rrd")
    assert rows["/world/final/semantic"] == rows["/world/final/objects"] == 1


def test_the_final_trajectory_is_where_the_run_put_it(semslam: Call, saved: Path, tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    semslam("view", saved, "--save", tmp_path / "view.rrd")
    chunks = RrdReader(tmp_path / "view.rrd").store().stream()
    batch = next(c.to_record_batch() for c in chunks if str(c.entity_path) == "/world/final/trajectory")
    column = batch.column("LineStrips3D:strips")
    points = np.array(column.to_pylist()[0][0])
    written = np.loadtxt(saved / "trajectory.txt")[:, 1:4]
    assert points == pytest.approx(written, abs=1e-5)


def test_a_replay_is_shown_too(wall: WallDataset) -> None:
    scenes: list[int] = []

    class Counting:
        def track(self, frame: object, state: object) -> None: ...
        def keyframe(self, scene: object) -> None:
            scenes.append(1)

        def loops(self, scene: object) -> None: ...
        def finish(self, finished: object) -> None: ...
        def close(self) -> None: ...

    config = Config(detector="none")
    first = run(wall, config)
    replay(wall, first.recording, config, viewer=Counting())
    assert len(scenes) == len(first.slam.keyframes)


def test_without_the_package_it_is_one_sentence(
    semslam: Call, saved: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    outcome = semslam("view", saved, "--save", tmp_path / "view.rrd")
    assert outcome.code == 2
    assert "pip install 'semslam[rerun]'" in outcome.err
    assert "Traceback" not in outcome.err


def test_a_window_is_started_and_may_be_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The program that comes with the package is started; nothing listens here, as after its window was closed."""
    import rerun_bindings

    started: list[dict[str, object]] = []
    monkeypatch.setattr(rerun_bindings, "spawn", lambda **options: started.append(options))
    monkeypatch.setattr(rerun_viewer, "PATIENCE", 0.2)
    problems: list[str] = []
    viewer = BackgroundViewer(lambda: open_viewer("room", None, live=True), problems.append, WorkerKind.THREAD)
    viewer.close()
    assert len(started) == 1
    assert Path(str(started[0]["executable_path"])).is_file()
    assert len(problems) == 1
    assert problems[0].startswith("Nothing more is shown: The viewer did not take all of it")


def test_a_place_that_cannot_be_written_is_known_before_the_run(semslam: Call, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    outcome = semslam("run", SCENE, *OPTIONS, "--rerun", tmp_path / "file" / "run.rrd", "--out", tmp_path / "run")
    assert outcome.code == 2
    assert not (tmp_path / "run").exists()
