"""Plots: real files, the same bytes twice, with and without truth, loops and holes; settings for a paper hold."""

from dataclasses import replace
from itertools import pairwise

import cv2
import matplotlib
import numpy as np
import pytest

from semslam.errors import ConfigError, TrajectoryError
from semslam.eval.looks import LOOKS, SERIES, by_look
from semslam.eval.loops.reliability import ScoreBin, draw_reliability
from semslam.eval.report.drawing import RunDrawing
from semslam.eval.report.overlay import NamedTrajectory, draw_comparison
from semslam.eval.report.plots import draw_run
from semslam.eval.style import DPI, PictureFormat, PictureSettings
from semslam.types import LedgerEntry
from tests.eval.report.ledgers import ALL_KINDS
from tests.eval.report.samples import EMPTY, RUN, circle


def decoded(png: bytes) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return image


def is_picture(png: bytes) -> bool:
    image = decoded(png)
    return min(image.shape[:2]) > 300 and int(image.std()) > 5


@pytest.mark.parametrize(
    "run",
    [
        RUN,
        replace(RUN, truth=None),
        replace(RUN, loops=()),
        replace(RUN, truth=EMPTY),
        replace(RUN, loops=ALL_KINDS * 60),
        replace(RUN, odometry=circle(count=1), optimised=circle(count=1), truth=None, loops=()),
    ],
)
def test_every_kind_of_run_gives_four_pictures(run: RunDrawing) -> None:
    pictures = draw_run(run)
    assert list(pictures) == ["trajectory", "loops", "axes", "error"]
    assert all(is_picture(png) for png in pictures.values())


def test_the_path_stays_visible_among_many_loops() -> None:
    def blue(loops: tuple[LedgerEntry, ...]) -> int:
        image = decoded(draw_run(replace(RUN, loops=loops))["trajectory"])
        return int((np.abs(image.astype(int) - (178, 114, 0)).max(axis=2) < 12).sum())

    few, many = blue(ALL_KINDS[:1]), blue(ALL_KINDS[:1] * 400)
    assert many > 0.97 * few


@pytest.mark.parametrize("format", PictureFormat)
def test_the_same_run_gives_the_same_bytes_whatever_the_users_style(format: PictureFormat) -> None:
    settings = PictureSettings(format)
    expected = draw_run(RUN, settings)
    with matplotlib.rc_context({"axes.facecolor": "black", "font.size": 20}):
        assert draw_run(RUN, settings) == expected
        assert matplotlib.rcParams["font.size"] == 20
    start = {PictureFormat.PNG: b"\x89PNG", PictureFormat.PDF: b"%PDF", PictureFormat.SVG: b"<?xml"}[format]
    assert all(content.startswith(start) for content in expected.values())


def test_size_title_and_font_are_those_asked_for() -> None:
    settings = PictureSettings(size=(3.5, 2.6), font="DejaVu Serif", font_size=7.0, title="")
    pictures = draw_run(RUN, settings)
    assert {decoded(png).shape[:2] for png in pictures.values()} == {(int(2.6 * DPI), int(3.5 * DPI))}
    assert pictures != draw_run(RUN, replace(settings, title="a title"))
    assert pictures != draw_run(RUN, replace(settings, font="DejaVu Sans"))


def test_nothing_is_cut_off_in_a_column_of_a_paper() -> None:
    settings = PictureSettings(size=(3.2, 2.6), font_size=8.0)
    runs = [NamedTrajectory(name, circle()) for name in ("semantic", "fused", "thumbnail", "none at all")]
    for png in (*draw_run(RUN, settings).values(), *draw_comparison(runs, circle(), "", settings).values()):
        image = decoded(png)
        assert (image[:, [0, -1]] == 255).all()
        assert (image[-1] == 255).all()


def test_lines_are_thinner_in_a_smaller_picture() -> None:
    def share(settings: PictureSettings) -> float:
        image = decoded(draw_run(replace(RUN, loops=()), settings)["axes"]).astype(int)
        return float((np.abs(image - (178, 114, 0)).max(axis=2) < 60).mean())

    assert share(PictureSettings(size=(4.5, 3.0))) < 1.4 * share(PictureSettings())


def test_a_font_that_is_not_there_is_one_sentence() -> None:
    with pytest.raises(ConfigError, match="'No Such Font' is not installed"):
        draw_run(RUN, PictureSettings(font="No Such Font"))


def test_nothing_to_draw_is_one_sentence() -> None:
    with pytest.raises(TrajectoryError, match="no pose"):
        draw_run(replace(RUN, optimised=EMPTY))
    with pytest.raises(TrajectoryError, match="no pose"):
        draw_comparison([NamedTrajectory("a", EMPTY)], None, "nothing")


def test_runs_lie_over_one_another() -> None:
    runs = [NamedTrajectory("one", circle(0.05)), NamedTrajectory("two", circle(0.01)), NamedTrajectory("lost", EMPTY)]
    with_truth = draw_comparison(runs, circle(), "rings")
    assert list(with_truth) == ["trajectories", "errors"]
    assert all(is_picture(png) for png in with_truth.values())
    assert list(draw_comparison(runs, None, "rings")) == ["trajectories"]


def test_what_differs_in_colour_differs_in_dashes_or_marker_too() -> None:
    for one, other in pairwise(SERIES):
        assert (one.color != other.color) and (one.line != other.line)
    assert len(set(SERIES)) == len(SERIES)
    in_graph = {(look.line, look.marker) for look in LOOKS if look.is_in_graph}
    assert len(in_graph) == 3
    assert set(by_look(ALL_KINDS)) == set(LOOKS)


def test_the_reliability_picture_names_the_numbers_of_pairs() -> None:
    bins = [ScoreBin(0.0, 0.1, 5321, 0.05, 0.0), ScoreBin(0.9, 1.0, 17, 0.95, 0.9)]
    svg = draw_reliability(bins, "house", PictureSettings(PictureFormat.SVG)).decode()
    assert "<!-- 5321 -->" in svg
    assert "<!-- 17 -->" in svg
    assert is_picture(draw_reliability([], "none"))
