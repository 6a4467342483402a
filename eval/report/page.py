"""The report of a run: one HTML page that carries its pictures inside, needs no network and runs no script."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from string import Template

import cv2
import numpy as np

from semslam.eval.style import IN_GRAPH, LOOKS, LoopKind
from semslam.types import NodePair, UInt8Array

PICTURES_SHOWN = 24
THUMBNAIL_WIDTH = 300
JPEG_QUALITY = 82
CAPTIONS = {
    "trajectory": "The paths, seen along the direction in which they reach least far, with the loops in the graph.",
    "loops": "Every candidate at the time of its query and of its match.",
    "axes": "Position over time.",
    "error": "Before and after the loops, over time; ticks mark accepted loops.",
}
# Node colours in RGB, apart for colour-blind readers, taken in turn.
NODE_COLORS = ((0, 158, 115), (230, 159, 0), (86, 180, 233), (240, 228, 66), (213, 94, 0), (204, 121, 167))


@dataclass(frozen=True, slots=True)
class ErrorRow:
    """One error of both trajectories; None where there is no ground truth for it."""

    name: str
    unit: str
    odometry: float | None
    optimised: float | None


@dataclass(frozen=True, slots=True, eq=False)
class ReportLoop:
    """A loop candidate as the report tells it.

    Attributes:
        query: id of the newer keyframe.
        match: id of the older one.
        query_time: seconds since the start.
        match_time: seconds since the start.
        score: the detector's score, 0..1.
        kind: what became of it.
        reason: why, in a few words; empty where it simply passed.
        figures: names and values of the evidence and of the verification.
        labels: class names that both frames share.
        nodes: matched semantic nodes, drawn into the picture.
        images: (H, W, 3) RGB of query and match, for loops that are to be shown.
    """

    query: int
    match: int
    query_time: float
    match_time: float
    score: float
    kind: LoopKind
    reason: str = ""
    figures: tuple[tuple[str, float], ...] = ()
    labels: tuple[str, ...] = ()
    nodes: tuple[NodePair, ...] = ()
    images: tuple[UInt8Array, UInt8Array] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ReportInput:
    """Everything on the page.

    Attributes:
        title: the sequence and what ran on it.
        facts: names and values of the tiles at the top.
        errors: trajectory errors with and without loops; empty without ground truth.
        pictures: PNG files by name, as ``semslam.eval.report.plots.draw_run`` gives them.
        loops: all candidates, in order.
        notes: what was mended or left out, a sentence each.
        settings: the effective settings as YAML.
    """

    title: str
    facts: tuple[tuple[str, str], ...]
    errors: tuple[ErrorRow, ...]
    pictures: Mapping[str, bytes]
    loops: tuple[ReportLoop, ...]
    notes: tuple[str, ...] = ()
    settings: str = ""


def loops_to_show(kinds: Sequence[LoopKind], limit: int = PICTURES_SHOWN) -> list[int]:
    """Positions of at most ``limit`` loops in the graph whose images deserve a place on the page, in order.

    False and inaccurate ones come first; the others are spread over the run.
    """
    doubtful = [i for wanted in (LoopKind.FALSE, LoopKind.INACCURATE) for i, kind in enumerate(kinds) if kind is wanted]
    sound = [i for i, kind in enumerate(kinds) if kind in (LoopKind.TRUE, LoopKind.ACCEPTED)]
    room = max(limit - len(doubtful), 0)
    spread = np.linspace(0, len(sound) - 1, min(room, len(sound))).round().astype(int)
    return sorted([*doubtful[:limit], *(sound[i] for i in spread)])


def make_report(report: ReportInput) -> str:
    """The page as HTML. Pictures and thumbnails are embedded; texts are escaped."""
    return PAGE.substitute(
        title=escape(report.title),
        facts="".join(f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>" for name, value in report.facts),
        errors=_error_table(report.errors),
        pictures="".join(_picture(caption, png) for caption, png in report.pictures.items()),
        shown=_shown(report.loops),
        loops=_loop_table(report.loops),
        notes=_notes(report.notes),
        settings=f"<details><summary>Settings</summary><pre>{escape(report.settings)}</pre></details>"
        if report.settings
        else "",
    )


def draw_pair(loop: ReportLoop, width: int = THUMBNAIL_WIDTH) -> UInt8Array:
    """Query and match side by side, each ``width`` pixels wide, with matched nodes joined by lines.

    Raises:
        ValueError: the loop carries no images.
    """
    if loop.images is None:
        raise ValueError("The loop carries no images.")
    scales = [width / image.shape[1] for image in loop.images]
    heights = [round(image.shape[0] * scale) for image, scale in zip(loop.images, scales, strict=True)]
    canvas = np.full((max(heights), 2 * width + 4, 3), 255, np.uint8)
    for left, height, image in zip((0, width + 4), heights, loop.images, strict=True):
        canvas[:height, left : left + width] = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    for index, node in enumerate(loop.nodes):
        color = NODE_COLORS[index % len(NODE_COLORS)]
        a = (round(node.query_uvd[0] * scales[0]), round(node.query_uvd[1] * scales[0]))
        b = (round(node.match_uvd[0] * scales[1]) + width + 4, round(node.match_uvd[1] * scales[1]))
        cv2.line(canvas, a, b, color, 1, cv2.LINE_AA)
        for point in (a, b):
            cv2.circle(canvas, point, 5, (255, 255, 255), -1, cv2.LINE_AA)
            cv2.circle(canvas, point, 4, color, -1, cv2.LINE_AA)
        cv2.putText(canvas, node.label, (a[0] + 7, a[1] + 4), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (0, 0, 0), 3, cv2.LINE_AA)
        cv2.putText(canvas, node.label, (a[0] + 7, a[1] + 4), cv2.FONT_HERSHEY_SIMPLEX, 0.38, color, 1, cv2.LINE_AA)
    return canvas


def _error_table(rows: Sequence[ErrorRow]) -> str:
    if not any(row.optimised is not None or row.odometry is not None for row in rows):
        return "<p class=quiet>There is no ground truth, so no error is known.</p>"
    body = "".join(
        f"<tr><td>{escape(row.name)}</td><td>{_value(row.odometry, row.unit)}</td>"
        f"<td>{_value(row.optimised, row.unit)}</td><td>{_change(row)}</td></tr>"
        for row in rows
    )
    return f"<table><tr><th>Error<th>odometry alone<th>optimised<th>change</tr>{body}</table>"


def _value(value: float | None, unit: str) -> str:
    return "–" if value is None else f"{value:.4f} {escape(unit)}".strip()


def _change(row: ErrorRow) -> str:
    if row.odometry is None or row.optimised is None or row.odometry == 0:
        return "–"
    percent = 100 * (row.optimised / row.odometry - 1)
    return (
        f"<span class={'better' if percent < 0 else 'worse'}>{percent:+.1f} %</span>" if abs(percent) > 0.05 else "same"
    )


def _picture(name: str, png: bytes) -> str:
    caption = escape(CAPTIONS.get(name, name))
    data = base64.b64encode(png).decode("ascii")
    image = f'<img alt="{caption}" src="data:image/png;base64,{data}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"


def _shown(loops: Sequence[ReportLoop]) -> str:
    cards = [_card(loop) for loop in loops if loop.images is not None]
    in_graph = sum(loop.kind in IN_GRAPH for loop in loops)
    if not cards:
        return ""
    return f"<h2>Loops in the graph: {len(cards)} of {in_graph} shown</h2><div class=cards>{''.join(cards)}</div>"


def _card(loop: ReportLoop) -> str:
    _, jpeg = cv2.imencode(".jpg", draw_pair(loop)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    data = base64.b64encode(jpeg.tobytes()).decode("ascii")
    labels = f"<br>shared: {escape(', '.join(loop.labels))}" if loop.labels else ""
    return (
        f'<figure class="card"><img alt="keyframes {loop.query} and {loop.match}" src="data:image/jpeg;base64,{data}">'
        f"<figcaption>{_badge(loop.kind)} <b>{loop.query} → {loop.match}</b>, "
        f"{loop.query_time:.1f} s → {loop.match_time:.1f} s, score {loop.score:.3f}<br>"
        f"{_figures(loop)}{labels}</figcaption></figure>"
    )


def _loop_table(loops: Sequence[ReportLoop]) -> str:
    if not loops:
        return "<p class=quiet>No loop was proposed.</p>"
    body = "".join(
        f"<tr><td>{loop.query} → {loop.match}</td><td>{loop.query_time:.2f} → {loop.match_time:.2f}</td>"
        f"<td>{loop.score:.3f}</td><td>{_badge(loop.kind)}</td><td>{escape(loop.reason)}</td>"
        f"<td>{_figures(loop)}</td></tr>"
        for loop in loops
    )
    head = "<tr><th>keyframes<th>seconds<th>score<th>verdict<th>reason<th>figures</tr>"
    return f"<details open><summary>{len(loops)} candidates</summary><table class=loops>{head}{body}</table></details>"


def _badge(kind: LoopKind) -> str:
    return f'<span class="badge" style="background:{LOOKS[kind].color}">{escape(kind.value)}</span>'


def _figures(loop: ReportLoop) -> str:
    return ", ".join(f"{escape(name)}&nbsp;{value:.4g}" for name, value in loop.figures)


def _notes(notes: Sequence[str]) -> str:
    return f"<h2>Notes</h2><ul>{''.join(f'<li>{escape(note)}</li>' for note in notes)}</ul>" if notes else ""


PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
body { font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; color: #222; background: #f6f7f8; margin: 0; }
main { max-width: 1180px; margin: 0 auto; padding: 28px 24px 60px; }
h1 { font-size: 26px; margin: 0 0 18px; } h2 { font-size: 18px; margin: 36px 0 12px; }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(100px, 1fr)); gap: 10px; }
.facts div, table, figure, details { background: #fff; border: 1px solid #e2e4e7; border-radius: 8px; }
.facts div { padding: 10px 14px; } .facts b { display: block; font-size: 19px; }
.facts span { color: #667; font-size: 13px; }
table { border-collapse: separate; border-spacing: 0; padding: 4px 12px; font-variant-numeric: tabular-nums; }
th { text-align: left; color: #667; font-weight: 600; font-size: 13px; } th, td { padding: 5px 18px 5px 0; }
tr + tr td { border-top: 1px solid #eceef0; } td { vertical-align: top; }
.loops { border: 0; width: 100%; font-size: 13px; } .loops td { padding-right: 12px; }
.loops td:nth-child(-n+4) { white-space: nowrap; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(480px, 1fr)); gap: 14px; align-items: start; }
.cards { display: grid; grid-template-columns: repeat(auto-fill, minmax(360px, 1fr)); gap: 14px; }
figure { margin: 0; padding: 10px; } figure img { width: 100%; display: block; border-radius: 4px; }
figcaption { color: #556; font-size: 13px; padding-top: 6px; }
.badge { color: #fff; border-radius: 9px; padding: 1px 8px; font-size: 12px; }
.better { color: #00795a; } .worse { color: #b34700; } .quiet { color: #667; }
details { padding: 10px 14px; } summary { cursor: pointer; } pre { overflow-x: auto; font-size: 13px; }
</style></head><body><main>
<h1>$title</h1>
<div class="facts">$facts</div>
<h2>Errors against ground truth</h2>$errors
<h2>Pictures</h2><div class="pictures">$pictures</div>
$shown
<h2>All loop candidates</h2>$loops
$notes
<h2>How it was made</h2>$settings
</main></body></html>
""")
