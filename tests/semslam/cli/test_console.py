"""What commands print while they work, and how they name things."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from semslam.cli import progress
from semslam.cli.app import _show_warning
from semslam.cli.console import complain, every_nth, metrics_table, out, remark, text_table
from semslam.cli.options import completer
from semslam.config import Config
from semslam.eval.report.tables import Table
from semslam.runs.pipeline import run
from semslam.runs.results import write_run
from tests.conftest import Call, WallDataset


@pytest.mark.parametrize(
    ("number", "words"), [(1, "every"), (2, "every 2nd"), (3, "every 3rd"), (5, "every 5th"), (12, "every 12th")]
)
def test_ordinals(number: int, words: str) -> None:
    assert every_nth(number) == words
    assert every_nth(number + 100).endswith({1: "101st", 2: "102nd", 3: "103rd", 5: "105th", 12: "112th"}[number])


def test_a_line_every_ten_seconds_and_none_before(capsys: pytest.CaptureFixture[str]) -> None:
    times: Iterator[float] = iter([0.0, 4.0, 11.0, 12.0, 22.0])
    update = progress.progress_lines("room", 40, "frames", lambda: next(times))
    for done in (4, 11, 12, 22):
        update(done, None)
    assert capsys.readouterr().err.splitlines() == [
        "room: 11 of 40 frames (28 %) after 11 s",
        "room: 22 of 40 frames (55 %) after 22 s",
    ]


def test_the_last_of_several_names_is_completed() -> None:
    complete = completer(lambda: ["none", "semantic", "semantic-paper"])
    assert complete("none,sem") == ["none,semantic", "none,semantic-paper"]
    assert complete("n") == ["none"]


def test_sequences_to_download_are_listed(semslam: Call) -> None:
    assert "fr1/room" in semslam("download", "--list").out.splitlines()
    assert semslam("download").code == 2


def test_help_names_detectors_and_odometries(semslam: Call) -> None:
    text = semslam("run", "--help").out
    assert "semantic-paper" in text
    assert "feature_map" in text


EVIL = "\x1b]0;owned\x07\x9b31m\u202e"


def test_no_control_character_of_a_file_reaches_the_terminal(
    semslam: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wall = WallDataset(name=f"wall{EVIL}")
    result = run(wall, Config(detector="none"))
    out.print(metrics_table([result.metrics], result.metrics.sequence))
    out.print(text_table(Table(EVIL, ("a", EVIL), ((EVIL, EVIL),), (EVIL,))))
    out.print(f"Results: {EVIL}")
    complain(EVIL)
    remark(EVIL)
    _show_warning(EVIL, UserWarning, EVIL, 1)
    progress.progress_lines(EVIL, 2, "frames", iter([0.0, 20.0]).__next__)(1, None)
    printed = capsys.readouterr()
    write_run(result, wall, tmp_path / "run", plots=False)
    checked = semslam("check", tmp_path / "run", "--max-maps", 1)
    for text in (printed.out, printed.err, checked.out):
        assert "owned" in text
        assert all(character.isprintable() for character in text.replace("\n", ""))


def test_work_of_unknown_length_is_reported_too(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "SECONDS_BETWEEN_LINES", 0.01)
    with progress.busy("stress"):
        while "stress: 0 s" not in capsys.readouterr().err:
            pass
