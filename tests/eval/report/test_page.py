"""The pages: self-contained, escaped, complete, and honest without truth."""

import json
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from semslam.errors import TrajectoryError
from semslam.eval.report.content import ErrorRow
from semslam.eval.report.page import make_comparison, make_report, make_suite
from tests.eval.report.ledgers import ALL_KINDS
from tests.eval.report.samples import COMPARISON, EMPTY, REPORT, RUN, SUITE, circle


class Collector(HTMLParser):
    """Collects tags that are opened and closed, what they link to and the data of scripts."""

    def __init__(self) -> None:
        super().__init__()
        self.opened: list[str] = []
        self.closed: list[str] = []
        self.sources: list[str] = []
        self.data = ""
        self._in_data = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.opened.append(tag)
        self.sources += [value or "" for name, value in attrs if name in ("src", "href", "data")]
        self._in_data = ("type", "application/json") in attrs

    def handle_endtag(self, tag: str) -> None:
        self.closed.append(tag)
        self._in_data = False

    def handle_data(self, data: str) -> None:
        if self._in_data:
            self.data += data


def parsed(page: str) -> Collector:
    parser = Collector()
    parser.feed(page)
    return parser


@pytest.mark.parametrize("page", [make_report(REPORT), make_comparison(COMPARISON), make_suite(SUITE)])
def test_a_page_carries_everything_and_links_nowhere(page: str) -> None:
    tags = parsed(page)
    assert all(source.startswith("data:") or "://" not in source for source in tags.sources)
    assert "default-src 'none'" in page
    for tag in ("div", "table", "figure", "details", "main", "span", "section", "script", "dl"):
        assert tags.opened.count(tag) == tags.closed.count(tag), tag
    assert len(page) < 5_000_000


def test_texts_are_escaped() -> None:
    page = make_report(REPORT)
    assert "kitchen &amp; &lt;b&gt;hall&lt;/b&gt;" in page
    for raw in ("<note>", "<x-setting>", "chair <1>"):
        assert raw not in page
    assert json.loads(parsed(page).data)["candidates"][0]["nodes"] == [["chair <1>", 10, 10, 30, 21]]


def test_what_is_due_to_loops_and_to_the_adjustment_stands_apart() -> None:
    page = make_report(REPORT)
    assert "by the loops" in page
    assert "-80.0 %" in page
    assert "-50.0 %" in page
    unknown = make_report(replace(REPORT, errors=(ErrorRow("ATE", "m", 0.4, None, 0.1),)))
    assert "by the loops" not in unknown
    assert "did not record" in unknown
    assert "-75.0 %" in unknown


def test_every_candidate_is_there_with_all_its_values() -> None:
    data = json.loads(parsed(make_report(REPORT)).data)
    assert [kind["name"] for kind in data["kinds"]] == [
        "true", "accepted", "inaccurate", "false", "withdrawn", "rejected", "skipped",
    ]  # fmt: skip
    assert len(data["candidates"]) == len(ALL_KINDS)
    true, (withdrawn, rejected, skipped) = data["candidates"][0], data["candidates"][-3:]
    assert rejected["reason"] == "few inliers: 12, limit 20"
    assert skipped["reason"] == "repeats loops of neighbouring keyframes: 4, limit 4"
    assert withdrawn["reason"] == "outlier in the graph: 9.1, limit 4.7"
    groups = {title: dict(values) for title, values in true["groups"]}
    assert groups["Proposal"]["rotation"] == "1.25"
    assert groups["Verification"]["inliers"] == "88"
    assert groups["Pose graph"]["ATE without it"] == "+0.20 mm"
    assert groups["Ground truth"]["error of the relative pose"] == "3.0 cm, 0.40°"
    assert true["matches"] == [[1, 2, 3, 4]]


def test_settings_stages_notes_and_origin_are_shown() -> None:
    page = make_report(REPORT)
    for text in ("loops.follow", "12.3 ms", "a &lt;note&gt;", "semslam run kitchen", "It works.", "700 MB"):
        assert text in page
    assert "All settings are at their defaults" in make_report(replace(REPORT, changes=()))


def test_errors_of_different_frames_are_not_compared() -> None:
    row = ErrorRow("ATE", "m", 0.4, 0.08, 0.04, comparable=False)
    assert (row.by_loops, row.in_all, row.by_adjustment) == (None, None, -0.5)
    assert "no change is stated" in make_report(replace(REPORT, errors=(row,)))
    assert "no change is stated" not in make_report(REPORT)


def test_the_objects_of_the_semantic_map_are_listed() -> None:
    page = make_report(REPORT)
    assert page.count("<td>refridgerator</td>") == 2
    assert "1.80 × 0.60 × 0.60" in page
    assert "Semantic map" not in make_report(replace(REPORT, semantic=None))


def test_without_truth_and_without_loops() -> None:
    page = make_report(replace(REPORT, drawing=replace(RUN, truth=None, loops=()), errors=()))
    assert "There is no ground truth" in page
    assert "No loop was proposed" in page


def test_a_run_without_poses_is_one_sentence() -> None:
    with pytest.raises(TrajectoryError, match="no pose"):
        make_report(replace(REPORT, drawing=replace(RUN, optimised=EMPTY)))


def test_long_trajectories_are_thinned() -> None:
    long = circle(count=90_000)
    data = json.loads(parsed(make_report(replace(REPORT, drawing=replace(RUN, optimised=long)))).data)
    assert max(len(line["x"]) for line in data["view"]["lines"]) <= 4000


def test_the_same_input_gives_the_same_page() -> None:
    assert make_report(REPORT) == make_report(REPORT)


def test_a_comparison_links_its_runs_pages() -> None:
    tags = parsed(make_comparison(COMPARISON))
    assert "semantic/report.html" in tags.sources
    assert len(json.loads(tags.data)["errors"]) == 2
