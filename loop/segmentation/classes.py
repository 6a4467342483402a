"""The 40 indoor classes of NYU Depth v2 (Gupta et al., CVPR 2013), their colours and their groups."""

import colorsys

import numpy as np
import numpy.typing as npt

NYU40_NAMES: tuple[str, ...] = (
    "void", "wall", "floor", "cabinet", "bed", "chair", "sofa", "table", "door", "window", "bookshelf",
    "picture", "counter", "blinds", "desk", "shelves", "curtain", "dresser", "pillow", "mirror", "floor mat",
    "clothes", "ceiling", "books", "refridgerator", "television", "paper", "towel", "shower curtain", "box",
    "whiteboard", "person", "night stand", "toilet", "sink", "lamp", "bathtub", "bag", "otherstructure",
    "otherfurniture", "otherprop",
)  # fmt: skip
"""Class names by label; the spelling is the data set's own."""

CLASS_COUNT = len(NYU40_NAMES) - 1

MOVABLE: frozenset[str] = frozenset(
    {"chair", "pillow", "clothes", "books", "paper", "towel", "box", "person", "bag", "otherprop"}
)
"""Classes that often stand elsewhere on a later visit."""

GROUPS: dict[str, tuple[str, ...]] = {
    "wall": ("wall", "whiteboard", "otherstructure"),
    "floor": ("floor", "floor mat"),
    "ceiling": ("ceiling",),
    "storage": (
        "cabinet", "counter", "dresser", "night stand", "refridgerator", "shelves", "bookshelf", "otherfurniture",
    ),
    "bed": ("bed", "pillow"),
    "seat": ("chair", "sofa"),
    "table": ("table", "desk"),
    "opening": ("door", "window", "blinds", "curtain", "shower curtain"),
    "picture": ("picture", "mirror", "television"),
    "books": ("books", "paper"),
    "person": ("person",),
    "bathroom": ("toilet", "sink", "bathtub"),
    "lamp": ("lamp",),
    "thing": ("clothes", "towel", "box", "bag", "otherprop"),
}  # fmt: skip
"""Classes that the network often takes for one another, joined: what it can tell apart."""

GROUP_NAMES: tuple[str, ...] = ("void", *GROUPS)


def _group_index() -> npt.NDArray[np.uint8]:
    group_of = {name: i for i, names in enumerate(GROUPS.values(), start=1) for name in names}
    return np.array([group_of.get(name, 0) for name in NYU40_NAMES], dtype=np.uint8)


def _palette() -> npt.NDArray[np.uint8]:
    # The golden angle spreads hues so that neighbours in the list differ; three brightnesses do the rest.
    colors = [
        colorsys.hsv_to_rgb(i * 0.618034 % 1.0, (0.75, 0.5, 0.9)[i % 3], (0.95, 0.75, 0.6)[i // 3 % 3])
        for i in range(CLASS_COUNT)
    ]
    return np.round(np.array([(0.0, 0.0, 0.0), *colors]) * 255).astype(np.uint8)


GROUP_OF_LABEL: npt.NDArray[np.uint8] = _group_index()
"""(41,) index into ``GROUP_NAMES`` of each label: ``GROUP_OF_LABEL[labels]`` coarsens a label image."""

PALETTE: npt.NDArray[np.uint8] = _palette()
"""(41, 3) RGB colour of each label; void is black."""
