"""Report pages of runs and comparisons: self-contained HTML files."""

from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape

from semslam.eval.report.candidates import candidates_of, kinds_of
from semslam.eval.report.content import Fact, RunReport
from semslam.eval.report.curves import error_lines, view_of
from semslam.eval.report.drawing import aligned, error_curves, paths
from semslam.eval.report.overlay import NamedTrajectory, compared_errors, compared_paths
from semslam.eval.report.tables import Table
from semslam.eval.report.verdict import Verdict
from semslam.types import Trajectory

TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True, slots=True)
class ComparedRun:
    """A row of a comparison.

    Attributes:
        name: of the run, such as its detector.
        values: in the order of the comparison's headings.
        page: the run's own page, relative to the comparison's, or None.
    """

    name: str
    values: tuple[str, ...]
    page: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ComparisonReport:
    """The content of a comparison's page.

    Attributes:
        title: what was compared.
        verdict: the comparison in one sentence.
        headings: of the table, after the runs' names.
        runs: its rows.
        trajectories: final trajectories, for the plots.
        truth: ground truth, or None.
        origin: version, commit and command line.
    """

    title: str
    verdict: Verdict
    headings: tuple[str, ...]
    runs: tuple[ComparedRun, ...]
    trajectories: tuple[NamedTrajectory, ...]
    truth: Trajectory | None
    origin: tuple[Fact, ...] = ()


@dataclass(frozen=True, slots=True)
class SuiteReport:
    """Everything on the page of a suite of runs.

    Attributes:
        title: the suite's name.
        count: how many runs there were, in words.
        picture: of all methods, as a data URI, or None.
        tables: one for each sequence, and what there is besides.
        suite: its description as YAML.
    """

    title: str
    count: str
    picture: str | None
    tables: tuple[Table, ...]
    suite: str


def make_report(report: RunReport) -> str:
    """A run's page as HTML; texts are escaped.

    Raises:
        TrajectoryError: a trajectory of the run holds no pose.
    """
    run = aligned(report.drawing)
    data = {
        "view": asdict(view_of(paths(run), run.start)),
        "errors": [asdict(line) for line in error_lines(error_curves(run), run.start)],
        "errorTitle": "correction [cm]" if run.truth is None else "position error [cm]",
        "duration": round(run.end - run.start, 3),
        "kinds": [asdict(kind) for kind in kinds_of(run.loops)],
        "candidates": [asdict(candidate) for candidate in candidates_of(run, report.inliers)],
        "images": {key: asdict(image) for key, image in report.images.by_keyframe.items()},
    }
    return _render("run.html.j2", title=report.drawing.title, report=report, has_truth=run.truth is not None, data=data)


def make_comparison(report: ComparisonReport) -> str:
    """A comparison's page as HTML; texts are escaped.

    Raises:
        TrajectoryError: no run holds a pose.
    """
    shown = compared_paths(report.trajectories, report.truth)
    start = min(float(path.trajectory.timestamps[0]) for path in shown)
    data = {
        "view": asdict(view_of(shown, start)),
        "errors": [asdict(line) for line in error_lines(compared_errors(report.trajectories, report.truth), start)],
        "errorTitle": "position error [cm]",
        "duration": round(max(float(path.trajectory.timestamps[-1]) for path in shown) - start, 3),
        "kinds": [],
        "candidates": [],
        "images": {},
    }
    return _render("comparison.html.j2", title=report.title, report=report, data=data)


def make_suite(report: SuiteReport) -> str:
    """A suite's page as HTML; texts are escaped."""
    return _environment().get_template("suite.html.j2").render(report=report) + "\n"


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=select_autoescape(["html.j2"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["percent"] = lambda share: f"{100 * share:+.1f} %"
    environment.filters["metres"] = lambda values, between: between.join(f"{value:.2f}" for value in values)
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    return environment


def _render(template: str, **values: Any) -> str:
    return _environment().get_template(template).render(**values, plotly=_plotly()) + "\n"


def _plotly() -> str:
    """Plotly's basic bundle (MIT; see templates/plotly-LICENSE.txt)."""
    return (TEMPLATES / "plotly-basic.min.js").read_text(encoding="utf-8")
