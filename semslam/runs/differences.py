"""What changed between two saved runs, or between two parts of one."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from semslam.loop.segmentation.build import build_segmenter
from semslam.maps.changes import Change, ChangedThing, compare
from semslam.maps.semantic.semantic_map import VOXEL, build_semantic_map
from semslam.maps.views import PosedView
from semslam.runs.files import write_json
from semslam.runs.saved_views import Progress, SavedViews, silent
from semslam.types import Transform


def find_changes(
    before: SavedViews,
    after: SavedViews,
    T_before_after: Transform | None = None,
    voxel: float | None = None,
    progress: Progress = silent,
) -> tuple[Change, ...]:
    """Build both semantic maps in the first one's world and compare them.

    Args:
        before: the earlier keyframes.
        after: the later ones.
        T_before_after: (4, 4) takes points of the later world to the earlier one; None = they are one.
        voxel: side of a cell in metres; None = 4 cm.
        progress: called with the keyframes done and in all, from 0 again in each of the four passes over them.

    Raises:
        DatasetError: an image can no longer be read.
        ModelError: the network's weights cannot be used.
    """
    segmenter, size = build_segmenter(before.run.config), voxel or VOXEL

    def moved() -> Iterator[PosedView]:
        if T_before_after is None:
            return after.read(progress)
        return (replace(view, T_world_cam=T_before_after @ view.T_world_cam) for view in after.read(progress))

    maps = build_semantic_map(before.read(progress), segmenter, size), build_semantic_map(moved(), segmenter, size)
    return compare(*maps, before.read(progress), moved())


def change_values(changes: tuple[Change, ...]) -> list[dict[str, object]]:
    """Changes for tools; places are in the first run's world, metres."""
    return [_plain(change) for change in changes]


def write_changes(path: Path, changes: tuple[Change, ...]) -> None:
    """Write changes as JSON; places are in the first run's world.

    Raises:
        ResultsError: the file cannot be written.
    """
    write_json(path, change_values(changes))


def _plain(change: Change) -> dict[str, object]:
    return {
        "kind": change.kind.value,
        "distance_m": None if change.distance_m is None else round(change.distance_m, 3),
        "before": None if change.before is None else _plain_thing(change.before),
        "after": None if change.after is None else _plain_thing(change.after),
    }


def _plain_thing(thing: ChangedThing) -> dict[str, object]:
    return {
        "class": thing.name,
        "share": round(thing.share, 3),
        "area_m2": round(thing.area_m2, 4),
        "centroid_m": np.round(thing.centroid, 3).tolist(),
        "extent_m": np.round(thing.extent, 3).tolist(),
    }
