"""The class list, its groups and its colours."""

import numpy as np

from semslam.loop.segmentation.classes import (
    CLASS_COUNT,
    GROUP_NAMES,
    GROUP_OF_LABEL,
    GROUPS,
    MOVABLE,
    NYU40_NAMES,
    PALETTE,
)


def test_forty_distinct_classes_follow_void():
    assert NYU40_NAMES[0] == "void"
    assert CLASS_COUNT == 40
    assert len(set(NYU40_NAMES)) == 41


def test_known_places_of_the_standard_order():
    assert [NYU40_NAMES[i] for i in (1, 2, 5, 11, 22, 31, 40)] == [
        "wall", "floor", "chair", "picture", "ceiling", "person", "otherprop",
    ]  # fmt: skip


def test_movable_classes_are_classes():
    assert set(NYU40_NAMES) > MOVABLE


def test_groups_part_the_classes():
    grouped = [name for names in GROUPS.values() for name in names]
    assert sorted(grouped) == sorted(NYU40_NAMES[1:])
    for label, name in enumerate(NYU40_NAMES[1:], start=1):
        assert name in GROUPS[GROUP_NAMES[GROUP_OF_LABEL[label]]]
    assert GROUP_OF_LABEL[0] == 0


def test_colours_differ():
    assert PALETTE.shape == (41, 3)
    assert PALETTE.dtype == np.uint8
    assert len({tuple(color) for color in PALETTE.tolist()}) == 41
