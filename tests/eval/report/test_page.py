"""The report: self-contained, escaped, capped, and honest without truth."""

import re
from html.parser import HTMLParser

import numpy as np
import pytest

from semslam.eval.report.page import ErrorRow, ReportInput, ReportLoop, draw_pair, loops_to_show, make_report
from semslam.eval.style import LoopKind
from semslam.types import NodePair

IMAGE = np.tile(np.arange(64, dtype=np.uint8)[None, :, None], (48, 1, 3))
LOOP = ReportLoop(
    40, 3, 12.0, 1.0, 0.9, LoopKind.TRUE, figures=(("inliers", 88.0), ("rotation <deg>", 1.25)), labels=("chair",),
    nodes=(NodePair("chair", (10, 10, 2), (30, 20, 2)),), images=(IMAGE, IMAGE),
)  # fmt: skip
REFUSED = ReportLoop(41, 4, 12.5, 1.5, 0.7, LoopKind.REJECTED, reason="few inliers: 12 < 20")
REPORT = ReportInput(
    title="kitchen & <b>hall</b>",
    facts=(("frames tracked", "999 of 1000"),),
    errors=(ErrorRow("ATE", "m", 0.4, 0.1), ErrorRow("RPE", "m", None, None)),
    pictures={"trajectory": b"\x89PNG"},
    loops=(LOOP, REFUSED),
    notes=("a <note>",),
    settings="seed: 0 # <script>",
)


class Balance(HTMLParser):
    """Collects tags that are opened and closed."""

    def __init__(self) -> None:
        super().__init__()
        self.opened: list[str] = []
        self.closed: list[str] = []
        self.sources: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.opened.append(tag)
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        self.closed.append(tag)


def parsed(page: str) -> Balance:
    parser = Balance()
    parser.feed(page)
    return parser


def test_the_page_carries_everything_and_links_nowhere() -> None:
    page = make_report(REPORT)
    tags = parsed(page)
    assert tags.sources
    assert all(source.startswith("data:image/") for source in tags.sources)
    assert not re.search(r"https?://|@import|url\(", page)
    assert "script" not in tags.opened
    for tag in ("div", "table", "figure", "details", "main", "span"):
        assert tags.opened.count(tag) == tags.closed.count(tag), tag


def test_texts_are_escaped() -> None:
    page = make_report(REPORT)
    assert "kitchen &amp; &lt;b&gt;hall&lt;/b&gt;" in page
    for raw in ("<note>", "<script>", "<deg>"):
        assert raw not in page


def test_errors_loops_and_reasons_are_told() -> None:
    page = make_report(REPORT)
    assert "0.1000 m" in page
    assert "-75.0 %" in page
    assert "few inliers: 12 &lt; 20" in page
    assert "40 → 3" in page
    assert "1 of 1 shown" in page


def test_without_truth_and_without_loops() -> None:
    page = make_report(ReportInput("empty", (), (ErrorRow("ATE", "m", None, None),), {}, ()))
    assert "no ground truth" in page
    assert "No loop was proposed" in page


def test_the_same_input_gives_the_same_page() -> None:
    assert make_report(REPORT) == make_report(REPORT)


def test_doubtful_loops_are_shown_first_and_the_rest_spread() -> None:
    kinds = [LoopKind.TRUE] * 50 + [LoopKind.FALSE, LoopKind.REJECTED, LoopKind.INACCURATE]
    shown = loops_to_show(kinds, 5)
    assert {50, 52} <= set(shown)
    assert len(shown) == 5
    assert 0 in shown
    assert 49 in shown
    assert loops_to_show([LoopKind.REJECTED] * 3) == []
    assert loops_to_show([LoopKind.FALSE] * 9, 4) == [0, 1, 2, 3]


def test_pair_picture_joins_both_frames() -> None:
    picture = draw_pair(LOOP, width=100)
    assert picture.shape == (75, 204, 3)
    with pytest.raises(ValueError, match="no images"):
        draw_pair(REFUSED)
