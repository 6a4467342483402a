"""Plots: real PNG, the same bytes twice, with and without truth, loops and holes."""

from dataclasses import replace

import cv2
import matplotlib
import numpy as np
import pytest

from semslam.errors import TrajectoryError
from semslam.eval.report.plots import LoopMark, RunDrawing, draw_run
from semslam.eval.style import LoopKind
from semslam.types import Trajectory


def circle(offset: float = 0.0, count: int = 90) -> Trajectory:
    angle = np.linspace(0, 2 * np.pi, count)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3], poses[:, 2, 3] = np.cos(angle) + offset * angle, np.sin(angle)
    return Trajectory(10 + np.arange(count) / 5, poses)


RUN = RunDrawing(
    "ring",
    circle(0.05),
    circle(0.01),
    circle(),
    tuple(LoopMark(27.0 - 0.1 * i, 11.0, k) for i, k in enumerate(LoopKind)),
)
EMPTY = Trajectory(np.empty(0), np.empty((0, 4, 4)))


def is_picture(png: bytes) -> bool:
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    return image is not None and min(image.shape[:2]) > 300 and int(image.std()) > 5


@pytest.mark.parametrize(
    "run",
    [
        RUN,
        replace(RUN, truth=None),
        replace(RUN, loops=()),
        replace(RUN, truth=EMPTY),
        replace(RUN, odometry=circle(count=1), optimised=circle(count=1), truth=None, loops=()),
    ],
)
def test_every_kind_of_run_gives_four_pictures(run: RunDrawing) -> None:
    pictures = draw_run(run)
    assert list(pictures) == ["trajectory", "loops", "axes", "error"]
    assert all(is_picture(png) for png in pictures.values())


def test_the_same_run_gives_the_same_bytes_whatever_the_users_style() -> None:
    expected = draw_run(RUN)
    with matplotlib.rc_context({"axes.facecolor": "black", "font.size": 20}):
        assert draw_run(RUN) == expected
        assert matplotlib.rcParams["font.size"] == 20


def test_nothing_to_draw_is_one_sentence() -> None:
    with pytest.raises(TrajectoryError, match="no pose"):
        draw_run(replace(RUN, optimised=EMPTY))
