"""A pose from small images, from a guess: where features starve, or ahead of a method that needs a close start."""

import numpy as np

from semslam.frontend.direct.alignment import Belief
from semslam.frontend.direct.search import Registered, register
from semslam.frontend.direct.view import Level
from semslam.types import Transform

GUESS = np.eye(6) / 0.1**2
"""Information of a guess: a tenth of a radian and of a metre."""


def registered(
    reference: tuple[Level, ...] | None, current: tuple[Level, ...] | None, T_ref_cam: Transform
) -> Registered | None:
    """Register small images from a guess (4, 4); None where there are none, or where they do not match."""
    if reference is None or current is None:
        return None
    return register(reference, current, [T_ref_cam], Belief(T_ref_cam, GUESS))
