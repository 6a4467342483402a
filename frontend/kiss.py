"""Geometric odometry: KISS-ICP (Vizzo et al., RA-L 2023) on the back-projected depth image."""

from typing import Any, Self

import numpy as np

from semslam.config import Config, Section, setting
from semslam.frontend.prediction import ConstantVelocity, RecentVelocity, check_frame, first_motion
from semslam.geometry.se3 import invert, is_rigid, rotation_angle
from semslam.types import FloatArray, Frame, Motion, Points3, TrackingStatus, Transform

ALONG_SURFACE = 0.03
"""A point's information along its surface as a share of that across it: small, but edges constrain a little."""
NEIGHBOURS = 12
"""Neighbouring points from which a surface's normal is computed."""


class KissConfig(Section):
    """KISS-ICP with a preset for depth cameras."""

    max_range: float = setting(4.0, "depth above which points are ignored", unit="m", gt=0)
    voxel: float = setting(0.05, "voxel size of the local map", unit="m", gt=0)
    threshold: float = setting(0.02, "a third of the maximum correspondence distance", unit="m", gt=0)
    stride: int = setting(4, "use every n-th pixel in both directions", gt=0)
    min_points: int = setting(500, "minimum number of points of a scan", gt=10)
    max_surprise: float = setting(0.3, "distance from the prediction above which a scan is lost", unit="m", gt=0)
    max_surprise_rotation: float = setting(0.5, "rotation from the prediction above which it is lost", unit="rad", gt=0)
    sigma: float = setting(0.1, "error of one point that calibrates the covariance", unit="m", gt=0)


class KissOdometry:
    """Point-to-point ICP against a local voxel map, with a preset for depth cameras. Blind to colour."""

    name = "kiss"
    reads: tuple[str, ...] = ("kiss",)
    Settings = KissConfig

    def __init__(self, config: KissConfig) -> None:
        self._config = config
        self._icp = _make_icp(config)
        self._prediction = ConstantVelocity()
        self._recent = RecentVelocity()
        self._started = False
        self._lost_since: float | None = None
        self._map_id = 0

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        return cls(config.section(cls.name, cls.Settings))

    def track(self, frame: Frame) -> Motion:
        """Motion since the previous frame; LOST where there is too little depth or the scan does not match the map.

        Raises:
            DatasetError: the frame's size does not fit its intrinsics.
        """
        check_frame(frame)
        points = frame.intrinsics.back_project(frame.depth, step=self._config.stride).astype(np.float64)
        points = points[points[:, 2] <= self._config.max_range]
        T_prev_cur = self._prediction.predict(frame.timestamp)
        self._icp.last_delta = T_prev_cur
        T_odom_prev = self._icp.last_pose
        if len(points) >= self._config.min_points:
            _, source = self._icp.register_frame(points, np.zeros(0))
            moved = invert(T_odom_prev) @ self._icp.last_pose
            if not self._started or self._is_plausible(moved, T_prev_cur):
                return self._accept(frame.timestamp, moved, source)
        return self._lose(frame.timestamp, T_odom_prev, points)

    def _accept(self, timestamp: float, moved: FloatArray, source: FloatArray) -> Motion:
        self._prediction.tracked(timestamp, moved if self._started else np.eye(4))
        if not self._started:
            self._started = True
            return first_motion()
        status = TrackingStatus.OK if self._lost_since is None else TrackingStatus.RELOCALISED
        self._lost_since = None
        departure = self._recent.departure(timestamp, moved)
        return Motion(moved, self._covariance(source, departure), status, self._map_id, len(source))

    def _lose(self, timestamp: float, T_odom_prev: Transform, points: Points3) -> Motion:
        if not self._started:
            self._started = True
            self._prediction.tracked(timestamp, np.eye(4))
            return first_motion()
        self._lost_since = timestamp if self._lost_since is None else self._lost_since
        self._recent = RecentVelocity()
        # A scan that does not match the map has been written into it, so the map starts anew.
        if len(points) >= self._config.min_points:
            self._icp = _make_icp(self._config)
            self._icp.last_pose = T_odom_prev
            self._map_id += 1
        motion = self._prediction.lost(timestamp, self._map_id)
        self._icp.last_pose = T_odom_prev @ motion.T_prev_cur
        return motion

    def _is_plausible(self, moved: FloatArray, predicted: FloatArray) -> bool:
        if not is_rigid(moved):
            return False
        surprise = invert(predicted) @ moved
        return bool(
            np.linalg.norm(surprise[:3, 3]) <= self._config.max_surprise
            and rotation_angle(surprise) <= self._config.max_surprise_rotation
        )

    def _covariance(self, source: FloatArray, departure: FloatArray) -> FloatArray:
        """How well surfaces of this shape fix a pose, and how far the motion departs from those before it.

        Points slide along their surface: where all of it is one wall, nothing constrains the scan. A scan that
        slides fits as well as any other, but its motion departs from the camera's velocity.
        """
        normals = _normals(source)
        across = np.hstack([np.cross(source, normals), normals])
        x, y, z = source.T
        zero, one = np.zeros(len(source)), np.ones(len(source))
        rows = [[zero, z, -y, one, zero, zero], [-z, zero, x, zero, one, zero], [y, -x, zero, zero, zero, one]]
        anyway = np.concatenate([np.column_stack(row) for row in rows])
        information = across.T @ across + ALONG_SURFACE * anyway.T @ anyway
        registration = np.linalg.inv(information + 1e-6 * np.eye(6)) * self._config.sigma**2
        return registration + np.outer(departure, departure)


def _normals(points: Points3) -> FloatArray:
    """Unit normals (N, 3) of the surface that points (N, 3) lie on."""
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    return np.asarray(cloud.normals, dtype=np.float64)


def _make_icp(config: KissConfig) -> Any:
    from kiss_icp.config.parser import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    settings = KISSConfig()
    settings.data.max_range = config.max_range
    settings.data.deskew = False
    settings.mapping.voxel_size = config.voxel
    settings.adaptive_threshold.fixed_threshold = config.threshold
    settings.registration.max_num_threads = 1
    return KissICP(settings)
