"""Dense RGB-D odometry, frame to frame: colour and depth of all pixels (Open3D's hybrid method)."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from semslam.config import Config, Section, setting
from semslam.frontend.direct.view import Level, contrast, make_levels
from semslam.frontend.frame_to_frame.images import registered
from semslam.frontend.frame_to_frame.reference import ReferenceOdometry, Registration
from semslam.frontend.straight_images import straightened
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import adjoint, invert, is_rigid
from semslam.runtime.threads import one_open3d_thread
from semslam.types import FloatArray, Frame, Transform

MIN_SIZE = 32
"""Pixels; smaller images have no pyramid."""
MEET = 0.05
"""Metres within which two depths are of one surface."""


class DenseConfig(Section):
    """Dense RGB-D registration, of frames to frames or to a keyframe."""

    max_depth: float = setting(4.0, "depth above which a measurement is ignored", unit="m", gt=0)
    steps: tuple[int, ...] = setting((10, 5, 3), "iterations, coarsest level first", min_length=1)
    min_coverage: float = setting(0.05, "share of pixels that must have depth", gt=0, le=1)
    min_contrast: float = setting(4.0, "standard deviation of an image's brightness", unit="grey levels", ge=0)
    min_fitness: float = setting(0.3, "share of pixels that must be inliers of a motion", gt=0, le=1)
    keyframe_translation: float = setting(
        0.1, "motion after which dense_keyframe replaces its keyframe", unit="m", ge=0
    )
    keyframe_rotation: float = setting(
        0.15, "rotation after which dense_keyframe replaces its keyframe", unit="rad", ge=0
    )
    sigma: float = setting(0.6, "error of one pixel's depth that calibrates the covariance", unit="m", gt=0)


@dataclass(frozen=True, slots=True, eq=False)
class DenseView:
    """A frame as Open3D takes it.

    Attributes:
        rgbd: Open3D's tensor RGBDImage, undistorted; float colour, depth in metres.
        intrinsics: the camera, without distortion.
        levels: the same images, small; None where they hold too little.
    """

    rgbd: Any
    intrinsics: Intrinsics
    levels: tuple[Level, ...] | None


class DenseRegistrar:
    """Registers undistorted RGB-D images to one another."""

    def __init__(self, config: DenseConfig) -> None:
        self._config = config

    def prepare(self, frame: Frame, velocity: FloatArray) -> DenseView | None:
        """The images as of one instant, without distortion; None where they are tiny, black or nearly without depth."""
        if min(frame.depth.shape) < MIN_SIZE or contrast(frame.color) < self._config.min_contrast:
            return None
        still = straightened(frame, velocity)
        usable = (still.depth > 0) & (still.depth <= self._config.max_depth)
        if np.count_nonzero(usable) < self._config.min_coverage * usable.size:
            return None
        import open3d as o3d

        depth = np.where(usable, still.depth, 0).astype(np.float32)
        image, tensor = o3d.t.geometry.Image, o3d.core.Tensor.from_numpy
        rgbd = o3d.t.geometry.RGBDImage(image(tensor(still.color.astype(np.float32) / 255.0)), image(tensor(depth)))
        return DenseView(rgbd, still.intrinsics, make_levels(still))

    def register(self, reference: DenseView, current: DenseView, T_ref_cam: Transform) -> Registration | None:
        """Register ``current`` to ``reference`` from an initial guess; None where too few pixels agree."""
        import open3d as o3d

        closer = registered(reference.levels, current.levels, T_ref_cam)  # Open3D's method converges from nearby alone
        odometry = o3d.t.pipelines.odometry
        matrix = o3d.core.Tensor.from_numpy(current.intrinsics.matrix)
        guess = o3d.core.Tensor.from_numpy(T_ref_cam if closer is None else closer.T_ref_cam)
        far = self._config.max_depth
        criteria = [odometry.OdometryConvergenceCriteria(steps) for steps in self._config.steps]
        try:
            with one_open3d_thread():
                found = odometry.rgbd_odometry_multi_scale(
                    current.rgbd, reference.rgbd, matrix, guess, 1.0, far, criteria, odometry.Method.Hybrid
                )
                T = found.transformation.numpy()
                information = odometry.compute_odometry_information_matrix(
                    current.rgbd.depth, reference.rgbd.depth, matrix, found.transformation, MEET, 1.0, far
                ).numpy()
        except RuntimeError:  # "Singular 6x6": no pixel pairs, or none that fix the pose
            return None
        if not is_rigid(T) or found.fitness < self._config.min_fitness:
            return None
        if np.linalg.cond(information) > 1e12:
            return None
        # Open3D moves the reference's points; the covariance belongs to the camera's side.
        Ad = adjoint(invert(T))
        variance = self._config.sigma**2
        covariance = Ad @ np.linalg.inv(information) @ Ad.T * variance
        inliers = round(found.fitness * current.intrinsics.width * current.intrinsics.height)
        return Registration(T, covariance, inliers, found.fitness < 2 * self._config.min_fitness)


class DenseOdometry(ReferenceOdometry[DenseView]):
    """Registers each frame to the one before by colour and depth (Park et al., ICCV 2017). Drifts: it has no map.

    LOST where there is no depth or the images do not match.
    """

    name = "dense"
    reads: tuple[str, ...] = ("dense",)
    Settings = DenseConfig

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        return cls(DenseRegistrar(config.section(cls.name, DenseConfig)))
