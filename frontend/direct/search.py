"""Direct registration from a guess, and from further ones where the camera turned otherwise than expected."""

from dataclasses import dataclass

import numpy as np

from semslam.frontend.direct.alignment import Alignment, Belief, align
from semslam.frontend.direct.clock import Clocks
from semslam.frontend.direct.view import Level
from semslam.geometry.se3 import exp_so3, make_transform
from semslam.types import FloatArray, Transform

TURNS = (-0.3, -0.15, 0.15, 0.3)
"""Radians by which the camera may have turned further, or less far, than expected: left and right, up and down."""
CONTRADICTION = 22.5
"""Squared Mahalanobis distance beyond which another estimate of a pose contradicts the registration: chi-square of six
degrees of freedom at 99.9 %."""
MIN_OVERLAP = 0.3
MIN_AGREEMENT = 0.9
MAX_COST = 1.5
SURE_AGREEMENT = 0.97
"""What a match needs: see ``Equations``. Right ones of real cameras agree by 0.98 and cost up to 1.2.

Where all but a few depths agree, brightness need not: light may have been switched.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Registered:
    """A frame registered to another.

    Attributes:
        T_ref_cam: (4, 4).
        information: (6, 6) of it; where the images state nothing it is that of the belief.
    """

    T_ref_cam: Transform
    information: FloatArray


def register(
    reference: tuple[Level, ...],
    current: tuple[Level, ...],
    starts: list[Transform],
    belief: Belief,
    clocks: Clocks | None = None,
    near: Transform | None = None,
) -> Registered | None:
    """Register a frame to another; None where they do not match.

    Args:
        reference: images of the other frame, coarsest first.
        current: images of the frame.
        starts: (4, 4) guesses, the likeliest first; turns around the last are tried where none leads to a match.
        belief: what is expected of the pose.
        clocks: when the rows of both were seen; None = at once.
        near: (4, 4) a guess that is good to a few pixels: the finest images alone are tried first.
    """
    if near is not None:
        found = align(reference[-1:], current[-1:], near, belief, clocks)
        if _matches(found):
            return _registered(found)
    for start in starts:
        found = align(reference, current, start, belief, clocks)
        if _matches(found):
            return _registered(found)
    turned = [starts[-1] @ turn for turn in _turns()]
    coarse = [align(reference[:1], current[:1], start, belief, clocks) for start in turned]
    best = min(coarse, key=lambda each: each.images.cost if each.images.overlap >= MIN_OVERLAP else np.inf)
    found = align(reference, current, best.T_ref_cam, belief, clocks)
    return _registered(found) if _matches(found) else None


def _matches(found: Alignment) -> bool:
    images = found.images
    alike = images.agreement >= MIN_AGREEMENT and images.cost <= MAX_COST
    return images.overlap >= MIN_OVERLAP and (alike or images.agreement >= SURE_AGREEMENT)


def _registered(found: Alignment) -> Registered:
    return Registered(found.T_ref_cam, found.images.information + found.belief.information)


def _turns() -> list[FloatArray]:
    """Rotations (4, 4) to either side, then up and down."""
    axes = np.eye(3)[[1, 0]]
    return [make_transform(exp_so3(axis * angle), np.zeros(3)) for axis in axes for angle in TURNS]
