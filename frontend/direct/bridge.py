"""A frame is registered to the last tracked one by its images: colour and depth."""

import numpy as np

from semslam.frontend.direct.alignment import Belief
from semslam.frontend.direct.clock import clocks_of
from semslam.frontend.direct.search import Registered, register
from semslam.frontend.direct.view import MIN_CONTRAST, Level, contrast, make_levels
from semslam.frontend.prediction import wide_covariance
from semslam.geometry.se3 import invert, tangent
from semslam.types import Covariance6, FloatArray, Frame, Transform

RESTLESS_ROTATION, RESTLESS_TRANSLATION = 6.0, 2.5
"""Standard deviation of a hand-held camera's acceleration, rad/s² and m/s²."""
INEXACT = 0.01
"""Share of a motion by which calibration falsifies it."""
SHORTEST = 1e-3
"""Seconds between two frames, at the least: stamps may be given twice."""
MAX_GAP = 0.5
"""Seconds from the last tracked frame after which too little of it is in view."""


class Bridge:
    """The last tracked frame, how it moved, and registration to it.

    Args:
        with_color: False = by depth alone.
    """

    def __init__(self, with_color: bool = True) -> None:
        self._with_color = with_color
        self._frame: Frame | None = None
        self._levels: tuple[Level, ...] | None = None
        self._levels_of: Frame | None = None
        self._velocity_covariance: FloatArray = np.eye(6)
        self._unmodelled: FloatArray = np.zeros((6, 6))
        self._T_tracked_prev: FloatArray = np.eye(4)
        self._is_lost = False
        self._velocity: FloatArray | None = None

    def tracked(self, frame: Frame, T_prev_cur: Transform, covariance: Covariance6) -> None:
        """Note a frame that was tracked, with its motion (4, 4) since the frame before and the covariance (6, 6)."""
        if self._frame is not None and not self._is_lost:
            seconds = max(frame.timestamp - self._frame.timestamp, SHORTEST)
            self._velocity_covariance = covariance / seconds**2
            self._velocity = tangent(T_prev_cur) / seconds
        self._frame = frame
        self._T_tracked_prev = np.eye(4)
        self._is_lost = False

    def lost(self, T_prev_cur: Transform) -> None:
        """Note the predicted motion (4, 4) of a frame that was not."""
        self._T_tracked_prev = self._T_tracked_prev @ T_prev_cur
        self._velocity = None
        self._is_lost = True

    def register(
        self,
        frame: Frame,
        T_prev_cur: Transform,
        readout: float,
        near: Transform | None = None,
        levels: tuple[Level, ...] | None = None,
    ) -> Registered | None:
        """Motion since the frame before, or None where the images do not match.

        Args:
            frame: the frame.
            T_prev_cur: (4, 4) predicted motion since the frame before, tracked or not.
            readout: seconds from colour's first row to its last.
            near: (4, 4) a better guess of it, good to a few pixels.
            levels: the frame's small images, where they have been made.
        """
        tracked = self._frame
        if tracked is None or frame.timestamp - tracked.timestamp > MAX_GAP:
            return None
        if self._with_color and contrast(frame.color) < MIN_CONTRAST:
            return None
        reference, current = self._levels_for(tracked), levels or make_levels(frame, self._with_color)
        if reference is None or current is None:
            return None
        seconds = max(frame.timestamp - tracked.timestamp, SHORTEST)
        T_tracked_prev = self._T_tracked_prev
        information = _inverse(self._expected(seconds))
        expected = T_tracked_prev @ T_prev_cur
        near = None if near is None else T_tracked_prev @ near
        before = None if self._velocity is None else self._velocity * seconds
        clocks = clocks_of(frame.intrinsics, readout, seconds, before)
        found = register(reference, current, [expected], Belief(expected, information), clocks, near)
        self._levels, self._levels_of = current, frame
        if found is None:
            return None
        self._unmodelled = _unmodelled(tangent(found.T_ref_cam), before, readout / seconds, current[-1])
        return Registered(invert(T_tracked_prev) @ found.T_ref_cam, found.information)

    def loosened(self, found: Registered, share: float = 1.0) -> Registered:
        """The frame that was registered last, less certain by what registration takes to be exact.

        Args:
            found: its motion.
            share: of the standard deviation of that.
        """
        return Registered(found.T_ref_cam, _inverse(_inverse(found.information) + share**2 * self._unmodelled))

    def _expected(self, seconds: float) -> Covariance6:
        """Covariance (6, 6) of the motion predicted over a time: velocity is known in part, and changes."""
        if self._is_lost:
            return wide_covariance(seconds)
        change = np.array([RESTLESS_ROTATION] * 3 + [RESTLESS_TRANSLATION] * 3) * seconds**2
        return self._velocity_covariance * seconds**2 + np.diag(change**2)

    def _levels_for(self, frame: Frame) -> tuple[Level, ...] | None:
        return self._levels if self._levels_of is frame else make_levels(frame, self._with_color)


def _unmodelled(motion: FloatArray, before: FloatArray | None, readout: float, seen: Level) -> Covariance6:
    """Covariance (6, 6) of what registration takes to be exact: the calibration, and how velocity changes.

    Over a read-out, given in parts of the time between the frames, velocity is taken to change evenly. What it really
    does is off by about as much as it changes. Rows seen at other instants than they are taken to be turn and shift
    the surface by that; what is taken for a shift grows with the distance of what is seen.

    Args:
        motion: (6,) between the frames.
        before: (6,) over as long a time until the first of them; None = not known.
        readout: from the first row to the last, in parts of the time between the frames.
        seen: images of the frame.
    """
    change = motion if before is None else motion - before
    turned, shifted = readout * np.linalg.norm(change[:3]), readout * np.linalg.norm(change[3:])
    shifted += turned * np.median(seen.points[:, 2])
    return np.diag((INEXACT * motion) ** 2 + np.repeat([turned, shifted], 3) ** 2)


def _inverse(matrix: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)
