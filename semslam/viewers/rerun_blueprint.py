"""How the viewer opens: the final map beside the live one, the camera's images, and how tracking goes."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rerun.blueprint import Blueprint

LIVE, FINAL, CAMERA, TRACKING = "world/live", "world/final", "world/live/camera", "tracking"
IMAGE = f"{CAMERA}/image"
ADDED_UP = ("path", "odometry", "landmarks", "cloud", "nodes", "loops/verified", "loops/rejected")
"""What grows below ``world/live``: everything up to the moment shown is shown together."""
SEMANTIC = ("semantic", "objects")
"""What the semantic map adds below ``world/final``."""


def make_blueprint(finished: bool, semantic: bool = False) -> "Blueprint":
    """The views and where they stand.

    Args:
        finished: whether the run is over, so that the final map comes first.
        semantic: whether there is a semantic map, which gets a view of its own.
    """
    import rerun.blueprint as rrb

    until_now = rrb.VisibleTimeRanges(
        timeline="frame", start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
    )
    live = rrb.Spatial3DView(
        name="Live",
        origin="world",
        contents=[f"+ /{LIVE}/**", f"- /{IMAGE}/depth", f"- /{IMAGE}/labels"],
        overrides={f"/{LIVE}/{part}": until_now for part in ADDED_UP},
    )
    contents = [f"+ /{FINAL}/**", *(f"- /{FINAL}/{part}" for part in SEMANTIC)]
    views = [live, rrb.Spatial3DView(name="Final", origin="world", contents=contents)]
    if semantic:
        contents = [f"+ /{FINAL}/{part}" for part in (*SEMANTIC, "trajectory")]
        views.append(rrb.Spatial3DView(name="Semantic", origin="world", contents=contents))
    images = rrb.Vertical(
        rrb.Spatial2DView(name="Colour and nodes", origin=IMAGE, contents=[f"+ /{IMAGE}/color", f"+ /{IMAGE}/nodes"]),
        rrb.Spatial2DView(name="Labels", origin=IMAGE, contents=[f"+ /{IMAGE}/labels"]),
        rrb.Spatial2DView(name="Depth", origin=IMAGE, contents=[f"+ /{IMAGE}/depth"]),
    )
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(rrb.Tabs(*views, active_tab=int(finished)), images, column_shares=[3, 1]),
            rrb.TimeSeriesView(name="Tracking", origin=TRACKING),
            row_shares=[5, 1],
        ),
        rrb.TimePanel(timeline="frame", state="collapsed"),
        collapse_panels=True,
    )
