"""Geometric odometry: KISS-ICP (Vizzo et al., RA-L 2023) on the back-projected depth image."""

from typing import Self

import numpy as np

from semslam.config import Config, Section, setting
from semslam.frontend.direct.bridge import Bridge
from semslam.frontend.direct.search import CONTRADICTION, Registered
from semslam.frontend.prediction import ConstantVelocity, RecentVelocity, check_frame, first_motion
from semslam.frontend.rolling_shutter import rectify_points, velocity_of
from semslam.frontend.voxel_map import Scan, VoxelMap
from semslam.geometry.reprojection import retract
from semslam.geometry.se3 import invert, is_rigid, orthonormalise, rotation_angle, tangent
from semslam.runtime.threads import one_blas_thread
from semslam.types import FloatArray, Frame, Motion, Points3, TrackingStatus, Transform

ALONG_SURFACE = 0.03
"""A point's information along its surface as a share of that across it: small, but edges constrain a little."""
NEIGHBOURS = 12
"""Neighbouring points from which a surface's normal is computed."""
LASTING = 0.3
"""Share of the error by a velocity that changes which lasts: what one frame is off by, the next takes back in part."""


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
    """KISS-ICP against a local voxel map, from where the depth image before puts the camera. Blind to colour.

    Points slide along surfaces when they are associated with the nearest ones, and slowly find back. So the depth image
    is registered to the one before as well, along its normals, and both make one estimate.
    """

    name = "kiss"
    reads: tuple[str, ...] = ("kiss",)
    Settings = KissConfig

    def __init__(self, config: KissConfig) -> None:
        self._config = config
        self._bridge = Bridge(with_color=False)
        self._map = self._new_map()
        self._T_map_prev: FloatArray = np.eye(4)
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
        """Motion since the previous frame; LOST where depth matches neither the map nor the image before.

        Raises:
            DatasetError: the frame's size does not fit its intrinsics.
        """
        check_frame(frame)
        with one_blas_thread():
            return self._track(frame)

    def _track(self, frame: Frame) -> Motion:
        if not self._started:
            self._started = True
            self._prediction.tracked(frame.timestamp, np.eye(4))
            self._remember(frame, self._scan(frame, np.zeros(6)), first_motion())
            return first_motion()
        predicted = self._prediction.predict(frame.timestamp)
        registered = self._bridge.register(frame, predicted, frame.intrinsics.readout or 0.0)
        guess = predicted if registered is None else registered.T_ref_cam
        scan = self._scan(frame, velocity_of(guess, self._prediction.seconds_since_last(frame.timestamp)))
        located = None if scan is None else self._locate(frame.timestamp, scan, guess)
        found = _one_estimate(registered, located)
        if found is None:
            return self._lose(frame.timestamp, scan)
        return self._accept(frame, scan, found if registered is None else self._bridge.loosened(found, LASTING))

    def _new_map(self) -> VoxelMap:
        return VoxelMap(self._config.voxel, self._config.max_range, self._config.threshold)

    def _scan(self, frame: Frame, velocity: FloatArray) -> Scan | None:
        """The frame's points, as a global shutter would see them; None where there are too few."""
        camera = frame.intrinsics
        points = camera.back_project(frame.depth, step=self._config.stride).astype(np.float64)
        points = points[points[:, 2] <= self._config.max_range]
        if len(points) < self._config.min_points:
            return None
        return self._map.scan(rectify_points(points, camera, velocity))

    def _locate(self, timestamp: float, scan: Scan, guess: Transform) -> Registered | None:
        """The motion by the map, or None where that is far from the guess."""
        if self._map.is_empty:
            return None
        moved = invert(self._T_map_prev) @ self._map.locate(scan, self._T_map_prev @ guess)
        if not self._is_plausible(moved, guess):
            return None
        covariance = self._covariance(scan.source, self._recent.departure(timestamp, moved))
        return Registered(moved, np.asarray(np.linalg.inv(covariance), dtype=np.float64))

    def _accept(self, frame: Frame, scan: Scan | None, found: Registered) -> Motion:
        self._prediction.tracked(frame.timestamp, found.T_ref_cam)
        status = TrackingStatus.OK if self._lost_since is None else TrackingStatus.RELOCALISED
        self._lost_since = None
        covariance = np.asarray(np.linalg.inv(found.information), dtype=np.float64)
        motion = Motion(found.T_ref_cam, covariance, status, self._map_id, 0 if scan is None else len(scan.source))
        self._remember(frame, scan, motion)
        return motion

    def _remember(self, frame: Frame, scan: Scan | None, motion: Motion) -> None:
        self._T_map_prev = orthonormalise(self._T_map_prev @ motion.T_prev_cur)
        if scan is not None:
            self._map.add(scan, self._T_map_prev)
        self._bridge.tracked(frame, motion.T_prev_cur, motion.covariance)

    def _lose(self, timestamp: float, scan: Scan | None) -> Motion:
        self._lost_since = timestamp if self._lost_since is None else self._lost_since
        self._recent = RecentVelocity()
        if scan is not None and not self._map.is_empty:
            self._map_id += 1
        motion = self._prediction.lost(timestamp, self._map_id)
        self._T_map_prev = orthonormalise(self._T_map_prev @ motion.T_prev_cur)
        if scan is not None:
            self._map = self._new_map()
            self._map.add(scan, self._T_map_prev)
        self._bridge.lost(motion.T_prev_cur)
        return motion

    def _is_plausible(self, moved: FloatArray, guess: FloatArray) -> bool:
        if not is_rigid(moved):
            return False
        surprise = invert(guess) @ moved
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


def _one_estimate(registered: Registered | None, located: Registered | None) -> Registered | None:
    """Both motions by their information; the first alone where they contradict each other."""
    if registered is None or located is None:
        return registered or located
    difference = tangent(invert(registered.T_ref_cam) @ located.T_ref_cam)
    together = np.linalg.inv(registered.information) + np.linalg.inv(located.information)
    if difference @ np.linalg.solve(together, difference) > CONTRADICTION:
        return registered
    information = registered.information + located.information
    step = np.asarray(np.linalg.solve(information, located.information @ difference), dtype=np.float64)
    return Registered(orthonormalise(retract(registered.T_ref_cam, step)), information)


def _normals(points: Points3) -> FloatArray:
    """Unit normals (N, 3) of the surface that points (N, 3) lie on."""
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    return np.asarray(cloud.normals, dtype=np.float64)
