"""A run folder is known by its manifest, and no file of it can be damaged unnoticed."""

import hashlib
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from semslam.config import Config
from semslam.errors import ResultsError
from semslam.runs.checkout import commit
from semslam.runs.manifest import Manifest, foreign_files, read_manifest, resealing, seal
from semslam.runs.pipeline import run
from semslam.runs.recording import read_front_end
from semslam.runs.results import READ, read_ledger, read_run, write_run
from tests.conftest import Call, WallDataset


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("runs") / "whole"
    wall = WallDataset(frames=6)
    write_run(run(wall, Config(detector="none")), wall, directory, plots=False)
    return directory


def shorten(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def flip(path: Path) -> None:
    content = bytearray(path.read_bytes() or b" ")
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def empty(path: Path) -> None:
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [shorten, flip, empty, Path.unlink])
@pytest.mark.parametrize("name", [*READ, "groundtruth.txt", "metrics.json", "manifest.json"])
def test_damage_to_any_file_that_is_read_is_an_error(
    whole: Path, tmp_path: Path, name: str, damage: Callable[[Path], None]
) -> None:
    run_folder = tmp_path / "run"
    shutil.copytree(whole, run_folder)
    before = (run_folder / name).read_bytes()
    damage(run_folder / name)
    if (run_folder / name).exists() and (run_folder / name).read_bytes() == before:
        pytest.skip("nothing to damage: the file is empty")
    with pytest.raises(ResultsError):
        read_run(run_folder)


def test_half_of_the_settings_stop_a_replay(whole: Path, tmp_path: Path) -> None:
    for name in ("config.yaml", "frontend.npz"):
        run_folder = tmp_path / name
        shutil.copytree(whole, run_folder)
        shorten(run_folder / name)
        with pytest.raises(ResultsError, match=r"is damaged: it is not what was written"):
            read_front_end(run_folder)


def test_a_run_that_was_not_finished_is_no_run(semslam: Call, whole: Path, tmp_path: Path) -> None:
    unfinished = tmp_path / "run.unfinished"
    shutil.copytree(whole, unfinished)
    outcome = semslam("ledger", unfinished)
    assert (outcome.code, "was not finished" in outcome.err) == (2, True)
    half = tmp_path / "half"
    shutil.copytree(whole, half)
    (half / "metrics.json").unlink()
    with pytest.raises(ResultsError, match=r"no finished run: it has no metrics\.json"):
        read_ledger(half)


def test_the_manifest_names_version_command_and_all_files(tmp_path: Path) -> None:
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots" / "loops.png").write_bytes(b"png")
    seal(tmp_path, "{}", ["semslam", "run", "room"])
    manifest = read_manifest(tmp_path)
    assert set(manifest.files) == {"plots/loops.png", "metrics.json"}
    assert manifest.command == ("semslam", "run", "room")
    assert manifest.version


def test_a_run_knows_its_commit_and_keeps_its_origin_when_files_are_added(tmp_path: Path) -> None:
    (tmp_path / "log.txt").write_text("")
    seal(tmp_path, "{}", ("semslam", "run", "room"))
    before = read_manifest(tmp_path)
    assert before.commit == commit()
    with resealing(tmp_path) as written:
        (tmp_path / "mesh.ply").write_text("mesh")
        written.append(tmp_path / "mesh.ply")
    after = read_manifest(tmp_path)
    assert "mesh.ply" in after.files
    assert (after.version, after.commit, after.command) == (before.version, before.commit, before.command)


def test_adding_files_hides_no_damage_and_takes_nobody_else_s_file(tmp_path: Path) -> None:
    for name in ("graph.g2o", "report.html"):
        (tmp_path / name).write_text(name)
    seal(tmp_path, "{}")
    (tmp_path / "thesis.tex").write_text("mine")
    (tmp_path / "graph.g2o").write_text("damaged")
    with resealing(tmp_path) as written:
        (tmp_path / "report.html").write_text("again")
        written.append(tmp_path / "report.html")
    manifest = read_manifest(tmp_path)
    manifest.check(tmp_path, "report.html")
    with pytest.raises(ResultsError, match=r"graph\.g2o is damaged"):
        manifest.check(tmp_path, "graph.g2o")
    assert foreign_files(tmp_path) == ["thesis.tex"]


def test_a_manifest_of_a_version_that_knew_of_no_commit_is_read() -> None:
    plain = Manifest(files={})
    text = f'{{"kind":"semslam run","version":"{plain.version}","command":null,"files":{{}}}}'
    assert plain.digest() == hashlib.sha256(text.encode()).hexdigest()
    assert plain.model_copy(update={"commit": "abc"}).digest() != plain.digest()
