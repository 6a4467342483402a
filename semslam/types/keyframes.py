"""A keyframe, and what a detector sees of it while it is fresh."""

from dataclasses import dataclass

from semslam.geometry.camera import Intrinsics
from semslam.types.arrays import Float32Array, FloatArray, Transform, UInt8Array
from semslam.types.features import Cloud, Features
from semslam.types.images import LabelMap


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
        velocity: (6,) angular and linear, radians and metres a second, in the camera's frame, by which keypoints and
            cloud are as a global shutter would have seen them; None where it is not known.
        around: the other keyframes of its submap, while a loop between submaps is verified.
    """

    id: int
    frame_index: int
    timestamp: float
    T_odom_cam: Transform
    map_id: int
    intrinsics: Intrinsics
    features: Features
    cloud: Cloud
    details: Features | None = None
    velocity: FloatArray | None = None
    around: tuple["Keyframe", ...] = ()

    @property
    def finest(self) -> Features:
        """The larger of the two keypoint sets: ``details`` where there are any, else ``features``."""
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
