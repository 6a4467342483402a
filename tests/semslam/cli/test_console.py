"""What commands print while they work, and how they name things."""

from collections.abc import Iterator

import pytest

from semslam.cli.console import every_nth
from semslam.cli.options import completer
from semslam.cli.progress import progress_lines
from tests.conftest import Call


@pytest.mark.parametrize(
    ("number", "words"), [(1, "every"), (2, "every 2nd"), (3, "every 3rd"), (5, "every 5th"), (12, "every 12th")]
)
def test_ordinals(number: int, words: str) -> None:
    assert every_nth(number) == words
    assert every_nth(number + 100).endswith({1: "101st", 2: "102nd", 3: "103rd", 5: "105th", 12: "112th"}[number])


def test_a_line_every_ten_seconds_and_none_before(capsys: pytest.CaptureFixture[str]) -> None:
    times: Iterator[float] = iter([0.0, 4.0, 11.0, 12.0, 22.0])
    update = progress_lines("room", 40, "frames", lambda: next(times))
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
