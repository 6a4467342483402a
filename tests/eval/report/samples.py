"""A run and a comparison with something of everything, for tests of pictures and pages."""

import cv2
import numpy as np

from semslam.eval.report.content import (
    ChangedSetting,
    ErrorRow,
    Fact,
    ObjectRow,
    RunReport,
    SemanticSection,
    StageTime,
)
from semslam.eval.report.drawing import RunDrawing
from semslam.eval.report.frames import KeyframeImage, LabelColor, data_uri, embed_images
from semslam.eval.report.intervals import Bar, draw_intervals
from semslam.eval.report.overlay import NamedTrajectory
from semslam.eval.report.page import ComparedRun, ComparisonReport, SuiteReport
from semslam.eval.report.tables import Table
from semslam.eval.report.verdict import Tone, Verdict
from semslam.runs.comparison import HEADINGS
from semslam.types import Trajectory
from tests.eval.report.ledgers import ALL_KINDS


def circle(offset: float = 0.0, count: int = 90) -> Trajectory:
    """A ring of poses over 18 s that opens by ``offset``."""
    angle = np.linspace(0, 2 * np.pi, count)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3], poses[:, 2, 3] = np.cos(angle) + offset * angle, np.sin(angle)
    return Trajectory(10 + np.linspace(0, 17.8, count), poses)


EMPTY = Trajectory(np.empty(0), np.empty((0, 4, 4)))
RUN = RunDrawing("kitchen & <b>hall</b>", circle(0.05), circle(0.01), circle(), ALL_KINDS)
IMAGE = np.tile(np.arange(64, dtype=np.uint8)[None, :, None], (48, 1, 3))
REPORT = RunReport(
    verdict=Verdict("It works.", Tone.GOOD),
    facts=(Fact("frames tracked", "999 of 1000"),),
    errors=(ErrorRow("ATE", "m", 0.4, 0.08, 0.04), ErrorRow("RPE", "m", None, None, None)),
    drawing=RUN,
    images=embed_images(
        ALL_KINDS, lambda frame: KeyframeImage(IMAGE, IMAGE // 64, (LabelColor("wall", "#ff0000", 0.5),))
    ),
    semantic=SemanticSection(
        data_uri("png", cv2.imencode(".png", IMAGE)[1].tobytes()),
        tuple(ObjectRow("refridgerator", 0.875, (1.0, -2.0, 0.5), (1.8, 0.6, 0.6), tuple(range(n))) for n in (40, 1)),
    ),
    inliers={0: np.array([[1.0, 2.0, 3.0, 4.0]])},
    stages=(StageTime("odometry", 12.34),),
    resources=(Fact("peak memory", "700 MB"),),
    changes=(ChangedSetting("loops.follow", "0", "3"),),
    origin=(Fact("command", "semslam run kitchen"),),
    notes=("a <note>",),
    settings="seed: 0 # <x-setting>",
)
COMPARISON = ComparisonReport(
    title="kitchen: 2 runs compared",
    verdict=Verdict("semantic is best.", Tone.GOOD),
    headings=HEADINGS,
    runs=(
        ComparedRun("none", ("28.0", *["28.03"] * 4, "1", "0 / 0 / 0", "0 / 0 / 0", "30.0")),
        ComparedRun(
            "semantic", ("4.0", *["4.03"] * 4, "1", "1143 / 465 / 448", "448 / 0 / 0", "8.5"), "semantic/report.html"
        ),
    ),
    trajectories=(NamedTrajectory("none", circle(0.05)), NamedTrajectory("semantic", circle(0.01))),
    truth=circle(),
)
SUITE = SuiteReport(
    title="fr1",
    count="8 runs, 1 failed",
    picture=data_uri(
        "png", draw_intervals([("desk", [Bar("semantic", 3.0, 2.5, 3.5, 8.0), Bar("peer", 4.0, ours=False)])])
    ),
    tables=(
        Table(
            "desk",
            ("method", *(f"a rather long heading, number {number}" for number in range(9))),
            tuple((name, *["4.03 ± 0.12"] * 9) for name in ("semantic with everything", "none")),
            ("a note",),
        ),
    ),
    suite="seeds: [0]",
)
