"""What flows between the stages. All of it is frozen.

Transforms name both frames, target first. Metres, radians, seconds. Covariances (6, 6) are in GTSAM's Pose3
tangent order, rotation first, and belong to the frame on the right of the transform's name.
"""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from semslam.errors import TrajectoryError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import Float32Array, FloatArray, is_rigid

__all__ = [
    "Cloud",
    "Features",
    "Float32Array",
    "FloatArray",
    "Frame",
    "Intrinsics",
    "Keyframe",
    "KeyframeView",
    "LabelMap",
    "LoopCandidate",
    "LoopConstraint",
    "LoopEvidence",
    "LoopRejection",
    "Motion",
    "NodePair",
    "Observations",
    "RejectionReason",
    "TrackingStatus",
    "Trajectory",
]

UInt8Array = npt.NDArray[np.uint8]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One RGB-D image of a sequence.

    Attributes:
        index: position in the sequence, from 0.
        timestamp: seconds.
        color: (H, W, 3) uint8 RGB, raw (distorted) pixels.
        depth: (H, W) float32 metres along the optical axis, registered to colour; 0 = none.
        intrinsics: the camera.
    """

    index: int
    timestamp: float
    color: UInt8Array
    depth: Float32Array
    intrinsics: Intrinsics


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Keypoints of one frame.

    Attributes:
        pixels: (N, 2) float32, undistorted.
        depths: (N,) float32 metres; 0 = none.
        octaves: (N,) uint8 pyramid levels.
        angles: (N,) float32 orientations in degrees.
        descriptors: (N, 32) uint8 binary descriptors (ORB).
        points: (N, 3) float32 camera-frame metres; rows without depth are zero.
    """

    pixels: Float32Array
    depths: Float32Array
    octaves: UInt8Array
    angles: Float32Array
    descriptors: UInt8Array
    points: Float32Array

    def __len__(self) -> int:
        return len(self.pixels)


@dataclass(frozen=True, slots=True, eq=False)
class Cloud:
    """A thinned point cloud in the camera frame.

    Attributes:
        points: (N, 3) float32 metres.
        normals: (N, 3) float32, of length 1.
        colors: (N, 3) uint8 RGB, where they are known.
    """

    points: Float32Array
    normals: Float32Array
    colors: UInt8Array | None = None

    def __len__(self) -> int:
        return len(self.points)


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
    """What odometry says of one frame.

    Attributes:
        T_prev_cur: (4, 4) motion since the previous frame; a prediction where the status is LOST.
        covariance: (6, 6) of T_prev_cur.
        status: how far to trust it.
        map_id: which map the pose belongs to; a new one starts where the tracker could not go on.
        inliers: matches or points that support the motion.
        observations: landmarks seen, where the odometry keeps any.
    """

    T_prev_cur: FloatArray
    covariance: FloatArray
    status: TrackingStatus
    map_id: int = 0
    inliers: int = 0
    observations: Observations | None = None


@dataclass(frozen=True, slots=True, eq=False)
class LabelMap:
    """A segmented image.

    Attributes:
        labels: (H, W) uint8, indices into ``names``; 0 is void.
        names: class names; ``names[0]`` is "void".
        confidence: (H, W) float32 in 0..1, or None where the segmenter has none.
    """

    labels: UInt8Array
    names: tuple[str, ...]
    confidence: Float32Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Keyframe:
    """What is kept of a keyframe; images are not, so that ten thousand fit.

    Attributes:
        id: 0, 1, 2... in order of creation; the key in the graph.
        frame_index: index of its frame.
        timestamp: seconds.
        T_odom_cam: (4, 4) odometry pose when it was made; never rewritten.
        map_id: the odometry's map it belongs to.
        intrinsics: the camera.
        features: keypoints with depth.
        cloud: a thinned cloud with normals.
        details: more keypoints, for the verification of loops; None = the features serve.
    """

    id: int
    frame_index: int
    timestamp: float
    T_odom_cam: FloatArray
    map_id: int
    intrinsics: Intrinsics
    features: Features
    cloud: Cloud
    details: Features | None = None

    @property
    def finest(self) -> Features:
        """The most keypoints there are."""
        return self.features if self.details is None else self.details


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeView:
    """A keyframe together with its images, as detectors see it while it is fresh; they must not keep it.

    Attributes:
        keyframe: what stays.
        color: (H, W, 3) uint8 RGB.
        depth: (H, W) float32 metres; 0 = none.
        labels: the segmentation, for detectors that ask for one.
    """

    keyframe: Keyframe
    color: UInt8Array
    depth: Float32Array
    labels: LabelMap | None = None


@dataclass(frozen=True, slots=True)
class NodePair:
    """Two semantic nodes that were matched.

    Attributes:
        label: class name.
        query_uvd: u, v in pixels and depth in metres in the query.
        match_uvd: the same in the match.
    """

    label: str
    query_uvd: tuple[float, float, float]
    match_uvd: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class LoopEvidence:
    """What made a detector propose a pair.

    Attributes:
        labels: class names both frames share.
        nodes: matched semantic nodes.
        figures: named scores that went into the decision.
    """

    labels: tuple[str, ...] = ()
    nodes: tuple[NodePair, ...] = ()
    figures: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LoopCandidate:
    """A pair of keyframes that a detector takes for the same place.

    Attributes:
        query: id of the newer keyframe.
        match: id of the older one.
        score: 0..1, higher is surer.
        detector: registered name of who proposed it.
        evidence: what agreed.
    """

    query: int
    match: int
    score: float
    detector: str
    evidence: LoopEvidence = LoopEvidence()


@dataclass(frozen=True, slots=True, eq=False)
class LoopConstraint:
    """A verified loop closure.

    Attributes:
        candidate: what was verified.
        T_match_query: (4, 4) pose of the query camera in the match camera.
        covariance: (6, 6) of T_match_query.
        fitness: share of the query's points that meet the match's surface, 0..1.
        inlier_rmse: metres, of those points.
        overlap: the smaller share of either view that the other one sees, 0..1.
        inliers: feature matches that support the pose.
        method: which estimate was kept, such as "pnp" or "icp".
        figures: what the steps on the way measured, by name.
        shared: (K, 2) int64 rows of the query's and of the match's ``finest`` features that agree, or None.
    """

    candidate: LoopCandidate
    T_match_query: FloatArray
    covariance: FloatArray
    fitness: float
    inlier_rmse: float
    overlap: float
    inliers: int
    method: str
    figures: dict[str, float] = field(default_factory=dict)
    shared: IntArray | None = None


class RejectionReason(StrEnum):
    """Why a candidate did not become a constraint, or a constraint did not stay."""

    FEW_MATCHES = "few_matches"
    FEW_INLIERS = "few_inliers"
    NO_CLOUD = "no_cloud"
    LOW_FITNESS = "low_fitness"
    HIGH_RMSE = "high_rmse"
    LOW_OVERLAP = "low_overlap"
    FREE_SPACE = "free_space"
    DEGENERATE = "degenerate"
    INCONSISTENT = "inconsistent"
    AMBIGUOUS = "ambiguous"
    OUTLIER = "outlier"


@dataclass(frozen=True, slots=True)
class LoopRejection:
    """A candidate that was refused.

    Attributes:
        candidate: what was refused.
        reason: the test it failed.
        figure: the value that failed.
        limit: the value it should have met.
    """

    candidate: LoopCandidate
    reason: RejectionReason
    figure: float
    limit: float


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses over time, checked on creation.

    Attributes:
        timestamps: (N,) seconds, strictly ascending.
        poses: (N, 4, 4) T_world_cam.

    Raises:
        TrajectoryError: shapes differ, a figure is not finite, stamps do not ascend, a rotation is not orthonormal.
    """

    timestamps: FloatArray
    poses: FloatArray

    def __post_init__(self) -> None:
        if self.timestamps.ndim != 1 or self.poses.shape != (len(self.timestamps), 4, 4):
            raise TrajectoryError(f"{self.timestamps.shape} stamps do not go with poses {self.poses.shape}.")
        if not np.isfinite(self.timestamps).all() or (np.diff(self.timestamps) <= 0).any():
            raise TrajectoryError("The trajectory's time stamps are not finite and strictly ascending.")
        if not is_rigid(self.poses):
            raise TrajectoryError("The trajectory holds a pose that is not finite or not a rigid transform.")

    def __len__(self) -> int:
        return len(self.timestamps)
