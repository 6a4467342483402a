"""A sheet of example pairs: what each group of the pair test looks like."""

from collections.abc import Sequence

import cv2
import numpy as np
from matplotlib.figure import Figure

from semslam.eval.pairs.judging import Pair, PairGroup
from semslam.eval.style import render
from semslam.types import UInt8Array

EXAMPLES = 3
THUMBNAIL = (320, 240)
SAME, OTHER = "#00795a", "#b34700"


def draw_sheet(pairs: Sequence[Pair], title: str) -> bytes:
    """A PNG with the same number of pairs of the same place (left) and of other places (right) for each group."""
    groups = [group for group in PairGroup if any(pair.group is group for pair in pairs)]

    def draw(figure: Figure) -> None:
        figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
        for row, band in enumerate(np.ravel(figure.subfigures(len(groups), 1, squeeze=False))):
            band.suptitle(groups[row].value, x=0.01, ha="left", fontsize=10)
            cells = band.subplots(1, 2 * EXAMPLES)
            for axes in cells:
                axes.set_axis_off()
            for first, same_place in ((0, True), (EXAMPLES, False)):
                fit = [pair for pair in pairs if pair.group is groups[row] and pair.same_place is same_place]
                for axes, pair in zip(cells[first:], _spread(fit), strict=False):
                    axes.imshow(_side_by_side(pair))
                    verdict = "same place" if same_place else "other place"
                    axes.set_title(f"{verdict}: {pair.kind}", fontsize=7, color=SAME if same_place else OTHER, pad=3)

    return render(draw, (16.0, 0.4 + 1.6 * len(groups)))


def _spread(pairs: Sequence[Pair]) -> list[Pair]:
    """Examples of different kinds where there are enough, evenly spaced in their order."""
    kinds = list({pair.kind: pair for pair in reversed(pairs)}.values())[::-1]
    kinds = kinds if len(kinds) >= EXAMPLES else list(pairs)
    places = np.linspace(0, len(kinds) - 1, min(EXAMPLES, len(kinds))).round().astype(int)
    return [kinds[int(place)] for place in places]


def _side_by_side(pair: Pair) -> UInt8Array:
    images = [cv2.resize(pair.load(side).color, THUMBNAIL, interpolation=cv2.INTER_AREA) for side in (0, 1)]
    gap = np.full((THUMBNAIL[1], 6, 3), 255, np.uint8)
    return np.asarray(np.concatenate([images[0], gap, images[1]], axis=1), dtype=np.uint8)
