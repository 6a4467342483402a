"""How uncertain the motion since the last keyframe is."""

from dataclasses import dataclass

from semslam.geometry.se3 import Covariance6, adjoint, invert
from semslam.types import Keyframe, Motion


@dataclass(slots=True)
class Anchor:
    """The last keyframe of a map, and the uncertainty (6, 6) of the motion since, in the current camera's tangent."""

    keyframe: Keyframe
    covariance: Covariance6

    def extend(self, motion: Motion) -> None:
        """Take in the motion of a further frame."""
        Ad = adjoint(invert(motion.T_prev_cur))
        self.covariance = Ad @ self.covariance @ Ad.T + motion.covariance
