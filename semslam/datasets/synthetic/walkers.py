"""Where persons walk: to and fro in front of the camera."""

import numpy as np

from semslam.datasets.synthetic.figure import Figure
from semslam.datasets.synthetic.path import Way, smooth
from semslam.datasets.synthetic.shapes import Part
from semslam.geometry.se3 import Points3

DISTANCES = (1.0, 1.7, 1.35)
"""Metres from the camera of each person; the nearest covers about 40 % of the image when in its middle."""
SWEEP = np.radians(55.0)
"""Angle from the camera's axis at which a person turns back; the image ends at 31 degrees."""
STEP = 1.4
"""Seconds from the axis to the turn."""
FINE = 0.05
"""Seconds between the places by which the way walked is measured."""


class Walkers:
    """Persons who cross the camera's view again and again, each at a distance of its own.

    They keep near the camera's axis as it moves, which is harder for tracking than a path that the view passes once.
    A wall or a piece of furniture that is nearer hides them.

    Args:
        figures: the persons.
        way: the camera's.
        seconds: how long.
    """

    def __init__(self, figures: tuple[Figure, ...], way: Way, seconds: float) -> None:
        knots = np.arange(-STEP, seconds + 2 * STEP, STEP)
        cameras = way.poses(np.clip(knots, 0.0, seconds))
        heading = np.arctan2(cameras[:, 1, 2], cameras[:, 0, 2])
        self._figures = figures
        self._times = np.arange(0.0, seconds + STEP, FINE)
        self._places = []
        for number in range(len(figures)):
            bearing = heading + SWEEP * np.sin(np.pi / 2 * np.arange(len(knots)) - np.pi / 2 + 2.1 * number)
            ahead = np.stack([np.cos(bearing), np.sin(bearing)], -1)
            self._places.append(smooth(knots, cameras[:, :2, 3] + DISTANCES[number] * ahead, self._times))

    def vertices(self, seconds: float) -> Points3:
        """Vertices (V, 3) of all persons in turn at a time, in the order of their parts."""
        return np.concatenate([self._vertices(number, seconds) for number in range(len(self._figures))])

    def _vertices(self, number: int, seconds: float) -> Points3:
        places = self._places[number]
        steps = np.diff(places, axis=0)
        k = int(np.clip(seconds / FINE, 0, len(steps) - 1))
        share = seconds / FINE - k
        walked = np.linalg.norm(steps[:k], axis=1).sum() + share * np.linalg.norm(steps[k])
        # Over half a second, so that a person turns round rather than flips.
        before, after = max(k - 5, 0), min(k + 6, len(places) - 1)
        towards = places[after] - places[before]
        x, y = places[k] + share * steps[k]
        return self._figures[number].posed(float(x), float(y), float(np.arctan2(towards[1], towards[0])), float(walked))


def persons(count: int) -> tuple[Figure, ...]:
    """Persons in clothes of their own."""
    return tuple(Figure(number) for number in range(count))


def parts_of(figures: tuple[Figure, ...]) -> list[Part]:
    """Surfaces of all persons in turn."""
    return [part for figure in figures for part in figure.parts]
