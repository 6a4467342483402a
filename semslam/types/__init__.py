"""What flows between the stages. All of it is frozen.

Transforms name both frames, target first. Metres, radians, seconds. Covariances (6, 6) are in GTSAM's Pose3
tangent order, rotation first, and belong to the frame on the right of the transform's name.
"""

from semslam.geometry.camera import Intrinsics
from semslam.types.arrays import (
    Covariance6,
    Float32Array,
    FloatArray,
    IntArray,
    Points3,
    Transform,
    Transforms,
    UInt8Array,
)
from semslam.types.features import Cloud, Features
from semslam.types.images import Frame, LabelMap
from semslam.types.keyframes import Keyframe, KeyframeView
from semslam.types.ledger import JudgedLoop, LedgerEntry, LoopContribution, LoopJudgement, LoopOutcome
from semslam.types.loops import (
    LoopCandidate,
    LoopConstraint,
    LoopEvidence,
    LoopRejection,
    NodePair,
    ObjectPair,
    RejectionReason,
    SubmapGuess,
    Verification,
)
from semslam.types.tracking import Motion, Observations, TrackingStatus
from semslam.types.trajectory import Trajectory

__all__ = [
    "Cloud",
    "Covariance6",
    "Features",
    "Float32Array",
    "FloatArray",
    "Frame",
    "IntArray",
    "Intrinsics",
    "JudgedLoop",
    "Keyframe",
    "KeyframeView",
    "LabelMap",
    "LedgerEntry",
    "LoopCandidate",
    "LoopConstraint",
    "LoopContribution",
    "LoopEvidence",
    "LoopJudgement",
    "LoopOutcome",
    "LoopRejection",
    "Motion",
    "NodePair",
    "ObjectPair",
    "Observations",
    "Points3",
    "RejectionReason",
    "SubmapGuess",
    "TrackingStatus",
    "Trajectory",
    "Transform",
    "Transforms",
    "UInt8Array",
    "Verification",
]
