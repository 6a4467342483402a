"""A RealSense: recordings that the SDK itself makes of a software device, which sends what a camera would."""

import builtins
from pathlib import Path

import numpy as np
import pytest

from semslam.datasets.dataset import Dataset
from semslam.datasets.realsense_camera import RealSenseCamera
from semslam.errors import DatasetError
from semslam.types import Frame
from tests.conftest import Call

WIDTH, HEIGHT, COUNT = 64, 48, 8
FOCAL = 60.0


@pytest.fixture(scope="module")
def sdk():
    return pytest.importorskip("pyrealsense2", reason="the extra 'realsense' is not installed")


def color_image(number: int) -> np.ndarray:
    return np.random.default_rng(number).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)


def depth_image(number: int) -> np.ndarray:
    return np.full((HEIGHT, WIDTH), 1000 + number, np.uint16)


def record(sdk, path: Path, leave_out: tuple[int, ...] = ()) -> Path:
    """What the SDK writes of eight frames, 33 ms apart, of depth in millimetres; color and depth in one place."""
    device = sdk.software_device()
    sensors = {name: device.add_sensor(name) for name in ("Depth", "Color")}
    sensors["Depth"].add_read_only_option(sdk.option.depth_units, 0.001)
    profiles = {}
    for uid, (name, kind, form, depth) in enumerate(
        (("Depth", sdk.stream.depth, sdk.format.z16, 2), ("Color", sdk.stream.color, sdk.format.rgb8, 3))
    ):
        camera = sdk.intrinsics()
        camera.width, camera.height, camera.fx, camera.fy = WIDTH, HEIGHT, FOCAL, FOCAL
        camera.ppx, camera.ppy, camera.model, camera.coeffs = 31.5, 23.5, sdk.distortion.none, [0, 0, 0, 0, 0]
        stream = sdk.video_stream()
        stream.type, stream.index, stream.uid, stream.fmt, stream.bpp = kind, 0, uid, form, depth
        stream.width, stream.height, stream.fps, stream.intrinsics = WIDTH, HEIGHT, 30, camera
        profiles[name] = sensors[name].add_video_stream(stream).as_video_stream_profile()
    recorder = sdk.recorder(str(path), device)
    queue = sdk.frame_queue(50)
    for sensor in recorder.query_sensors():
        sensor.open(sensor.get_stream_profiles())
        sensor.start(queue)
    for number in range(COUNT):
        if number in leave_out:
            continue
        for name, pixels in (("Depth", depth_image(number)), ("Color", color_image(number))):
            frame = sdk.software_video_frame()
            frame.pixels, frame.bpp = pixels, pixels.nbytes // (WIDTH * HEIGHT)
            frame.stride, frame.profile = frame.bpp * WIDTH, profiles[name]
            frame.timestamp, frame.domain = 1000 + 1000 / 30 * number, sdk.timestamp_domain.hardware_clock
            frame.frame_number = number
            if name == "Depth":
                frame.depth_units = 0.001
            sensors[name].on_video_frame(frame)
            assert queue.wait_for_frame(1000)
    for sensor in recorder.query_sensors():
        sensor.stop()
        sensor.close()
    del recorder
    return path


@pytest.fixture(scope="module")
def recording(sdk, tmp_path_factory) -> Path:
    return record(sdk, tmp_path_factory.mktemp("realsense") / "room.db3")


def opened(recording: Path) -> RealSenseCamera:
    """The recording, at no pace of its own."""
    camera = RealSenseCamera.open(recording)
    camera._playback.set_real_time(False)
    return camera


def played(recording: Path) -> tuple[RealSenseCamera, list[Frame]]:
    """The recording and its frames; on a busy machine the SDK may pass all of them before the first is awaited."""
    for _ in range(4):
        camera = opened(recording)
        frames = list(camera)
        if frames:
            return camera, frames
    pytest.skip("the SDK hands no frame out")


def test_a_recording_fills_the_role(recording: Path) -> None:
    camera = opened(recording)
    assert isinstance(camera, Dataset)
    assert (camera.name, camera.ground_truth, camera.notes) == ("room", None, [])
    assert (camera.intrinsics.width, camera.intrinsics.height, camera.intrinsics.fx) == (WIDTH, HEIGHT, FOCAL)
    assert len(camera) == 0
    camera, frames = played(recording)
    assert len(frames) == len(camera) > 0
    assert [frame.timestamp for frame in frames] == camera.timestamps == sorted(set(camera.timestamps))
    assert [frame.index for frame in frames] == list(range(len(frames)))
    numbers = [frame.source_index for frame in frames] + list(camera.dropped)
    assert sorted(numbers) == list(range(max(numbers) + 1))
    with pytest.raises(DatasetError, match="cannot be read again"):
        camera.frame(0)
    with pytest.raises(IndexError):
        camera.frame(len(camera))


def test_frames_are_rgb_and_metres(recording: Path) -> None:
    _, frames = played(recording)
    sent = [color_image(number) for number in range(COUNT)]
    for frame in frames:
        assert isinstance(frame, Frame)
        (number,) = (n for n, image in enumerate(sent) if np.array_equal(image, frame.color))
        assert frame.timestamp == pytest.approx(1 + number / 30, abs=1e-6)
        assert frame.depth.dtype == np.float32
        assert np.median(frame.depth) == pytest.approx(1 + 0.001 * number, abs=0.0015)


def test_frames_that_the_camera_left_out_are_counted(sdk, tmp_path: Path) -> None:
    camera, frames = played(record(sdk, tmp_path / "gaps.db3", leave_out=(4, 5)))
    sent = [color_image(number) for number in range(COUNT)]
    numbers = [next(n for n, image in enumerate(sent) if np.array_equal(image, f.color)) for f in frames]
    assert [frame.source_index for frame in frames] == [number - numbers[0] for number in numbers]
    seen = [frame.source_index for frame in frames]
    assert sorted([*seen, *camera.dropped]) == list(range(max(seen) + 1))


def test_the_command_plays_a_recording(recording: Path, semslam: Call, tmp_path: Path) -> None:
    out = tmp_path / "run"
    settings = ("--odometry", "feature", "--detector", "none", "--no-plots", "--out", out)
    done = semslam("live", recording, *settings)
    if done.code == 2:  # a machine so slow that eight frames passed before the first was awaited
        assert "No frame of room could be tracked" in done.err
        return
    assert done.code in (0, 3), "noise cannot be tracked"
    assert "frames dropped" in done.out
    assert "in real time" in (out / "log.txt").read_text()


def test_without_a_camera_it_is_one_sentence(sdk, semslam: Call) -> None:
    if len(sdk.context().query_devices()):
        pytest.skip("a camera is connected")
    done = semslam("live", "--detector", "none")
    assert (done.code, done.out) == (2, "")
    assert "There is no RealSense camera" in done.err


def test_without_the_package_it_is_one_sentence(semslam: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def no_sdk(name, *arguments, **named):
        if name == "pyrealsense2":
            raise ImportError(name)
        return real(name, *arguments, **named)

    monkeypatch.setattr(builtins, "__import__", no_sdk)
    done = semslam("live")
    assert done.code == 2
    assert "pip install 'semslam[realsense]'" in done.err


@pytest.mark.parametrize("content", [None, b"no recording"])
def test_what_is_no_recording_is_one_sentence(sdk, semslam: Call, tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "room.db3"
    if content is not None:
        path.write_bytes(content)
    done = semslam("live", path)
    assert done.code == 2
    assert str(path) in done.err
