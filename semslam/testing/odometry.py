"""What every odometry promises."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from semslam.config import Config
from semslam.errors import DatasetError
from semslam.frontend.odometry import Odometry, Preparing
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import compose, invert, is_rigid, rotation_angle
from semslam.testing.scenes import room
from semslam.testing.settings import check_settings
from semslam.types import Frame, Motion, TrackingStatus

TRACKED = {TrackingStatus.OK, TrackingStatus.DEGRADED, TrackingStatus.RELOCALISED}


class OdometryContract:
    """Inherit from it and name the class under test.

    Attributes:
        implementation: the odometry.
        config: settings to build it from.
        max_error_m, max_error_deg: how far the camera may be from its true pose after 16 frames of a rendered room,
            in which it moves by about 0.9 m.
    """

    implementation: ClassVar[type[Odometry]]
    config: ClassVar[Config] = Config()
    max_error_m: ClassVar[float] = 0.1
    max_error_deg: ClassVar[float] = 3.0

    def make(self) -> Odometry:
        """A fresh odometry."""
        return self.implementation.from_config(self.config)

    def test_it_fills_the_role(self) -> None:
        """It has every member, and reads only settings that exist."""
        odometry = self.make()
        assert isinstance(odometry, Odometry)
        assert odometry.name
        check_settings(self.implementation)
        settings = self.config.nested()
        own = odometry.name.replace("-", "_")
        for dotted in odometry.reads:
            section, _, key = dotted.partition(".")
            assert section in settings or section == own, f"'{dotted}' is no setting"
            assert not key or key in settings[section], f"'{dotted}' is no setting"

    def test_the_first_frame_is_identity(self) -> None:
        """The first frame is the origin of map 0."""
        motion = self.make().track(room().frames[0])
        assert_sound(motion)
        assert np.array_equal(motion.T_prev_cur, np.eye(4))
        assert motion.status is TrackingStatus.OK
        assert motion.map_id == 0

    def test_it_follows_the_camera(self) -> None:
        """After the rendered room's first frames the camera is where it should be."""
        clip, odometry = room(), self.make()
        motions = [odometry.track(frame) for frame in clip.frames]
        assert {motion.status for motion in motions} <= TRACKED
        pose = compose([motion.T_prev_cur for motion in motions[1:]], np.eye(4))[-1]
        error = invert(invert(clip.poses[0]) @ clip.poses[-1]) @ pose
        assert np.linalg.norm(error[:3, 3]) < self.max_error_m
        assert np.degrees(rotation_angle(error)) < self.max_error_deg

    def test_a_black_first_frame_does_not_raise(self) -> None:
        """A sequence may begin with nothing to see."""
        odometry = self.make()
        motions = [odometry.track(_without(room().frames[0], color=True, depth=True))]
        motions += [odometry.track(frame) for frame in room().frames[1:5]]
        for motion in motions:
            assert_sound(motion)
        assert np.array_equal(motions[0].T_prev_cur, np.eye(4))

    def test_the_same_input_gives_the_same_bytes(self) -> None:
        """Twice the same frames: twice the same motions."""
        runs = []
        for _ in range(2):
            odometry = self.make()
            motions = [odometry.track(frame) for frame in room().frames[:5]]
            runs.append(b"".join(m.T_prev_cur.tobytes() + m.covariance.tobytes() for m in motions))
        assert runs[0] == runs[1]

    def test_prepared_frames_give_the_same_motions(self) -> None:
        """What an odometry does ahead of a frame's turn changes nothing."""
        plain, ahead, frames = self.make(), self.make(), room().frames[:6]
        if not isinstance(ahead, Preparing):
            pytest.skip("it prepares nothing")
        for frame in frames:
            ahead.prepare(frame)
        for frame in frames:
            expected, motion = plain.track(frame), ahead.track(frame)
            assert np.array_equal(motion.T_prev_cur, expected.T_prev_cur)
            assert np.array_equal(motion.covariance, expected.covariance)

    def test_frames_are_left_as_they_are(self) -> None:
        """Images belong to the caller."""
        frames = room().frames[:3]
        copies = [(frame.color.copy(), frame.depth.copy()) for frame in frames]
        odometry = self.make()
        for frame in frames:
            odometry.track(frame)
        for frame, (color, depth) in zip(frames, copies, strict=True):
            assert np.array_equal(frame.color, color)
            assert np.array_equal(frame.depth, depth)

    @pytest.mark.parametrize("fault", ["black", "no depth", "black without depth", "nan depth"])
    def test_it_goes_on_after_a_fault(self, fault: str) -> None:
        """A frame with nothing to track is lost, none raises, and the map goes on afterwards."""
        odometry, frames = self.make(), room().frames
        for frame in frames[:4]:
            odometry.track(frame)
        during = [odometry.track(_spoilt(frame, fault)) for frame in frames[4:7]]
        after = [odometry.track(frame) for frame in frames[7:10]]
        for motion in during + after:
            assert_sound(motion)
        if fault == "black without depth":
            assert {motion.status for motion in during} == {TrackingStatus.LOST}
        assert after[-1].status in TRACKED
        assert after[-1].map_id == 0

    @pytest.mark.parametrize("size", [(1, 1), (3, 2), (40, 40)])
    def test_tiny_images_do_not_raise(self, size: tuple[int, int]) -> None:
        """No image is too small to be answered with a status."""
        width, height = size
        camera = Intrinsics(width, height, 50.0, 50.0, width / 2, height / 2)
        noise, odometry = np.random.default_rng(0), self.make()
        for i in range(3):
            color = noise.integers(0, 255, (height, width, 3), dtype=np.uint8)
            assert_sound(odometry.track(Frame(i, i / 30, color, np.ones((height, width), np.float32), camera)))

    def test_an_image_of_the_wrong_size_is_refused(self) -> None:
        """Image and intrinsics must fit; the message names the expected size."""
        frame = Frame(
            0, 0.0, np.zeros((10, 10, 3), np.uint8), np.zeros((10, 10), np.float32), room().frames[0].intrinsics
        )
        with pytest.raises(DatasetError, match="320 x 240"):
            self.make().track(frame)

    def test_a_gap_in_time_does_not_raise(self) -> None:
        """Frames may be missing."""
        odometry = self.make()
        for i in (0, 1, 2, 14, 15):
            assert_sound(odometry.track(room().frames[i]))


def assert_sound(motion: Motion) -> None:
    """A rigid motion with a symmetric, positive definite covariance."""
    assert is_rigid(motion.T_prev_cur)
    assert np.isfinite(motion.covariance).all()
    assert np.allclose(motion.covariance, motion.covariance.T)
    assert np.linalg.eigvalsh(motion.covariance).min() > 0


def _without(frame: Frame, *, color: bool = False, depth: bool = False) -> Frame:
    return replace(
        frame,
        color=np.zeros_like(frame.color) if color else frame.color,
        depth=np.zeros_like(frame.depth) if depth else frame.depth,
    )


def _spoilt(frame: Frame, fault: str) -> Frame:
    if fault == "nan depth":
        depth = frame.depth.copy()
        depth[::2] = np.nan
        return replace(frame, depth=depth)
    return _without(frame, color="black" in fault, depth="depth" in fault)
