"""Changes to frames: light alters colours alone, a removed object leaves both images, seeds repeat."""

import numpy as np
import pytest

from semslam.eval.pairs.changes import LIGHT, Change, change_frame, find_object
from semslam.geometry.camera import Intrinsics
from semslam.types import Frame

CAMERA = Intrinsics(160, 120, 120.0, 120.0, 80.0, 60.0)


def room() -> Frame:
    """A wall at 3 m with a box at 1.5 m before it."""
    rng = np.random.default_rng(0)
    color = rng.integers(60, 200, (120, 160, 3)).astype(np.uint8)
    depth = np.full((120, 160), 3.0, np.float32)
    depth[40:90, 50:100] = 1.5
    color[40:90, 50:100] = (250, 10, 10)
    return Frame(0, 0.0, color, depth, CAMERA)


@pytest.mark.parametrize("change", LIGHT)
def test_light_changes_colour_alone_and_repeats(change: Change) -> None:
    frame = room()
    before = frame.color.copy()
    changed = change_frame(frame, change, seed=3)
    assert np.array_equal(frame.color, before)
    assert not np.array_equal(changed.color, before)
    assert changed.depth is frame.depth
    assert changed.color.dtype == np.uint8
    assert np.array_equal(changed.color, change_frame(frame, change, seed=3).color)


def test_gamma_darkens_and_brightens() -> None:
    frame = room()
    dark, bright = (change_frame(frame, change).color.mean() for change in (Change.DARK, Change.BRIGHT))
    assert dark < frame.color.mean() < bright


def test_the_nearest_object_goes_out_of_colour_and_depth() -> None:
    frame = room()
    mask = find_object(frame.depth).astype(bool)
    assert mask[60, 75]
    assert not mask[10, 10]
    gone = change_frame(frame, Change.REMOVED)
    assert (gone.depth[40:90, 50:100] == 0).all()
    assert (gone.depth[:20] == 3).all()
    assert gone.color[65, 75, 1] > 60
    assert np.array_equal(gone.color[:20], frame.color[:20])


def test_a_bare_wall_has_no_object() -> None:
    frame = Frame(0, 0.0, room().color, np.full((120, 160), 3.0, np.float32), CAMERA)
    assert change_frame(frame, Change.REMOVED) is frame
    assert change_frame(frame, Change.NONE) is frame
