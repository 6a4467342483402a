"""Where a run is written: what is replaced, what is refused, and that runs keep out of one another's way."""

import os
from pathlib import Path

import pytest

from semslam.errors import ResultsError, SemslamWarning
from semslam.runs.manifest import seal
from semslam.runs.place import link_latest, new_directory, reopened, reserved, reserved_anew


def write(directory: Path, text: str) -> Path:
    """Put a run of one file there."""
    with reserved(directory) as place, place.results() as work:
        (work / "log.txt").write_text(text)
        seal(work, "{}")
    return place.directory


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_an_earlier_run_is_replaced_and_nothing_is_left_over(tmp_path: Path) -> None:
    write(tmp_path / "run", "old")
    write(tmp_path / "run", "new")
    assert (tmp_path / "run" / "log.txt").read_text() == "new"
    assert names(tmp_path) == {"run"}


@pytest.mark.parametrize("foreign", ["thesis.tex", "photos/cat.jpg"])
@pytest.mark.parametrize("is_run", [True, False])
def test_a_folder_with_anything_else_in_it_is_refused(tmp_path: Path, foreign: str, is_run: bool) -> None:
    run = tmp_path / "run"
    if is_run:
        write(run, "old")
    (run / foreign).parent.mkdir(parents=True, exist_ok=True)
    (run / foreign).write_text("mine")
    (run / "metrics.json").write_text("{}")
    with pytest.raises(ResultsError, match="holds something that no run wrote"), reserved(run):
        pass
    assert (run / foreign).read_text() == "mine"
    assert names(tmp_path) == {"run"}


def test_what_has_come_there_meanwhile_stays_and_the_results_get_another_name(tmp_path: Path) -> None:
    with reserved(tmp_path / "run") as place:
        (tmp_path / "run").mkdir()
        (tmp_path / "run" / "thesis.tex").write_text("mine")
        with place.results() as work:
            seal(work, "{}")
    assert (tmp_path / "run" / "thesis.tex").read_text() == "mine"
    assert place.directory == tmp_path / "run-2"
    assert (place.directory / "manifest.json").is_file()


def test_the_old_run_comes_back_where_the_new_one_cannot_take_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "run", "old")
    rename = Path.rename

    def fail(self: Path, target: Path) -> Path:
        if self.name == "results":
            raise OSError(5, "Input/output error")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fail)
    with pytest.raises(ResultsError, match="input/output error"):
        write(tmp_path / "run", "new")
    assert (tmp_path / "run" / "log.txt").read_text() == "old"
    assert names(tmp_path) == {"run"}


def test_half_a_replacement_is_undone(tmp_path: Path) -> None:
    write(tmp_path / "run", "old")
    (tmp_path / "run.unfinished").mkdir()
    (tmp_path / "run").rename(tmp_path / "run.unfinished" / "replaced")
    with reopened(tmp_path / "run"):
        assert (tmp_path / "run" / "log.txt").read_text() == "old"


def test_a_run_that_was_killed_is_given_up_with_a_remark(tmp_path: Path) -> None:
    (tmp_path / "run.unfinished").mkdir()
    (tmp_path / "run.unfinished" / "journal").write_bytes(b"half")
    with pytest.warns(SemslamWarning, match="was not finished is given up"):
        write(tmp_path / "run", "new")
    assert names(tmp_path) == {"run"}


def test_a_place_is_given_once(tmp_path: Path) -> None:
    with reserved(tmp_path / "run"), pytest.raises(ResultsError, match="Another run is being written"):
        write(tmp_path / "run", "second")


def test_runs_of_one_second_get_different_names(tmp_path: Path) -> None:
    with (
        reserved_anew(tmp_path, "room", "none") as one,
        reserved_anew(tmp_path, "room", "none") as two,
        reserved_anew(tmp_path, "room", "none") as three,
    ):
        assert len({one.directory, two.directory, three.directory}) == 3
    assert new_directory(tmp_path, "room", "compare") != new_directory(tmp_path, "room", "compare")


def test_an_error_keeps_what_is_worth_keeping(tmp_path: Path) -> None:
    for kept in (False, True):
        with pytest.raises(ResultsError, match="no"), reserved(tmp_path / "run") as place:
            place.kept = kept
            raise ResultsError("no")
        assert (tmp_path / "run.unfinished").exists() == kept


def test_what_cannot_be_written_is_known_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    for directory, complaint in (
        (tmp_path / "dangling", "is a link to nothing"),
        (tmp_path / "file", "is a file"),
        (tmp_path / "file" / "run", "cannot be written"),
        (tmp_path / ("n" * 300), "file name too long"),
        (Path("/proc/none"), "cannot be written"),
        (Path(), "is the folder that you are in"),
    ):
        with pytest.raises(ResultsError, match=complaint), reserved(directory):
            pass
    with pytest.raises(ResultsError, match="has room for"), reserved(tmp_path / "run", frames=10**12):
        pass
    assert names(tmp_path) == {"file", "dangling"}


def test_a_link_to_a_run_is_followed(tmp_path: Path) -> None:
    write(tmp_path / "run", "old")
    link_latest(tmp_path, tmp_path / "run")
    write(tmp_path / "latest", "new")
    assert (tmp_path / "latest").is_symlink()
    assert (tmp_path / "run" / "log.txt").read_text() == "new"


def test_latest_names_the_run_even_one_level_down(tmp_path: Path) -> None:
    write(tmp_path / "both" / "semantic", "x")
    link_latest(tmp_path, tmp_path / "both" / "semantic")
    assert (tmp_path / "latest" / "manifest.json").is_file()
    assert (tmp_path / "latest").readlink() == Path("both/semantic")


def test_a_folder_of_another_user_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "run", "theirs")
    monkeypatch.setattr(os, "geteuid", lambda: 4711)
    with pytest.raises(ResultsError, match="belongs to another user"), reserved(tmp_path / "run"):
        pass
