"""What every registered odometry promises."""

from pathlib import Path

import numpy as np
import pytest

from semslam import plugins
from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.errors import DatasetError
from semslam.frontend.odometry import Odometry
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import is_rigid
from semslam.types import Frame, Motion, TrackingStatus

NAMES = plugins.names("semslam.odometry")
CAMERA = Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0)


def make(name: str) -> Odometry:
    odometry = plugins.load("semslam.odometry", name).from_config(Config())
    assert isinstance(odometry, Odometry)
    return odometry


def black(index: int, timestamp: float, camera: Intrinsics = CAMERA) -> Frame:
    size = (camera.height, camera.width)
    return Frame(index, timestamp, np.zeros((*size, 3), np.uint8), np.zeros(size, np.float32), camera)


def assert_sound(motion: Motion) -> None:
    assert is_rigid(motion.T_prev_cur)
    assert np.isfinite(motion.covariance).all()
    assert np.allclose(motion.covariance, motion.covariance.T)
    assert np.linalg.eigvalsh(motion.covariance).min() > 0


@pytest.fixture(scope="module")
def kitchen(shared: Path) -> Dataset:
    return open_dataset(shared / "data" / "redkitchen")


@pytest.mark.parametrize("name", NAMES)
def test_first_frame_is_identity(name: str, kitchen: Dataset) -> None:
    motion = make(name).track(kitchen.frame(0))
    assert_sound(motion)
    assert np.array_equal(motion.T_prev_cur, np.eye(4))
    assert motion.status is TrackingStatus.OK
    assert motion.map_id == 0


@pytest.mark.parametrize("name", NAMES)
def test_black_first_frame_does_not_raise(name: str, kitchen: Dataset) -> None:
    odometry = make(name)
    motions = [odometry.track(black(0, 0.0)), *(odometry.track(kitchen.frame(i)) for i in range(1, 25, 6))]
    for motion in motions:
        assert_sound(motion)
    assert np.array_equal(motions[0].T_prev_cur, np.eye(4))


@pytest.mark.parametrize("name", NAMES)
def test_same_input_gives_same_bytes(name: str, kitchen: Dataset) -> None:
    runs = []
    for _ in range(2):
        odometry = make(name)
        motions = [odometry.track(kitchen.frame(i)) for i in range(0, 12, 3)]
        runs.append(b"".join(m.T_prev_cur.tobytes() + m.covariance.tobytes() for m in motions))
    assert runs[0] == runs[1]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("fault", ["black", "no depth", "no depth and no texture", "nan depth"])
def test_blind_frames_are_lost_and_the_track_resumes(name: str, fault: str, kitchen: Dataset) -> None:
    odometry = make(name)
    for i in range(4):
        odometry.track(kitchen.frame(i))
    during = [odometry.track(spoil(kitchen.frame(i), fault)) for i in range(4, 7)]
    after = [odometry.track(kitchen.frame(i)) for i in range(7, 10)]
    for motion in during + after:
        assert_sound(motion)
    if fault == "no depth and no texture":
        assert {motion.status for motion in during} == {TrackingStatus.LOST}
    assert after[-1].status in {TrackingStatus.OK, TrackingStatus.DEGRADED, TrackingStatus.RELOCALISED}
    assert after[-1].map_id == 0


def spoil(frame: Frame, fault: str) -> Frame:
    color, depth = frame.color, frame.depth
    if fault in {"black", "no depth and no texture"}:
        color = np.zeros_like(color)
    if fault in {"no depth", "no depth and no texture"}:
        depth = np.zeros_like(depth)
    if fault == "nan depth":
        depth = depth.copy()
        depth[::2] = np.nan
    return Frame(frame.index, frame.timestamp, color, depth, frame.intrinsics)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("size", [(1, 1), (3, 2), (40, 40)])
def test_tiny_images_do_not_raise(name: str, size: tuple[int, int]) -> None:
    camera = Intrinsics(*size, 50.0, 50.0, size[0] / 2, size[1] / 2)
    noise = np.random.default_rng(0)
    odometry = make(name)
    for i in range(3):
        color = noise.integers(0, 255, (size[1], size[0], 3), dtype=np.uint8)
        assert_sound(odometry.track(Frame(i, i / 30, color, np.ones((size[1], size[0]), np.float32), camera)))


@pytest.mark.parametrize("name", NAMES)
def test_wrong_size_is_refused(name: str) -> None:
    frame = Frame(0, 0.0, np.zeros((10, 10, 3), np.uint8), np.zeros((10, 10), np.float32), CAMERA)
    with pytest.raises(DatasetError, match="640 x 480"):
        make(name).track(frame)


@pytest.mark.parametrize("name", NAMES)
def test_gap_in_time_does_not_raise(name: str, kitchen: Dataset) -> None:
    odometry = make(name)
    for i in (0, 1, 2, 62, 63):
        assert_sound(odometry.track(kitchen.frame(i)))
