"""What odometry states of a frame."""

from dataclasses import dataclass
from enum import StrEnum

from semslam.types.arrays import Covariance6, Float32Array, IntArray, Transform


class TrackingStatus(StrEnum):
    """How much a frame's pose can be trusted."""

    OK = "ok"
    DEGRADED = "degraded"
    LOST = "lost"
    RELOCALISED = "relocalised"


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Landmarks seen in one frame, for bundle adjustment.

    Attributes:
        landmarks: (N,) int64 landmark identities.
        pixels: (N, 2) float32, undistorted.
        depths: (N,) float32 metres; 0 = none.
        sigmas: (N,) float32 pixels, how exact each keypoint is; None = all alike, 1 px.
    """

    landmarks: IntArray
    pixels: Float32Array
    depths: Float32Array
    sigmas: Float32Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """What odometry reports of one frame.

    Attributes:
        T_prev_cur: (4, 4) motion since the previous frame; a prediction where the status is LOST.
        covariance: (6, 6) of T_prev_cur.
        status: how far to trust it.
        map_id: which map the pose belongs to; a new one starts where the tracker could not go on.
        inliers: matches or points that support the motion.
        observations: landmarks seen, where the odometry keeps any.
    """

    T_prev_cur: Transform
    covariance: Covariance6
    status: TrackingStatus
    map_id: int = 0
    inliers: int = 0
    observations: Observations | None = None
