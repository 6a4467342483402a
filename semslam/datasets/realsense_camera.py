"""An Intel RealSense camera, or a recording of one, through the SDK's package pyrealsense2 (extra "realsense")."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Thread
from types import ModuleType
from typing import Any, Self

import numpy as np

from semslam.datasets.feed import Arrival, FrameQueue
from semslam.errors import ConfigError, DatasetError, printable
from semslam.geometry.camera import Intrinsics
from semslam.runtime.stopwatch import Stopwatch
from semslam.types import Frame, Trajectory

SILENCE_MS = 5000
"""Milliseconds without a frame after which a camera counts as gone."""
END_MS = 2000
"""The same of a recording, which ends without a word."""
COEFFICIENTS = ("none", "brown_conrady", "modified_brown_conrady")
"""The SDK's names of distortion models whose coefficients are OpenCV's."""


@dataclass(frozen=True, slots=True)
class CameraMode:
    """What a camera is asked for: pixels and frames per second, of colour and depth alike."""

    width: int = 640
    height: int = 480
    fps: int = 30


class RealSenseCamera:
    """Colour and depth registered to it, as they come; at once a ``Dataset`` and its ``Feed``.

    The dataset grows: its length is the number of frames that have been taken. Frames are numbered by the order in
    which they were; their number in the source is the camera's, which counts those that were dropped as well. Frames
    are not kept, so that none can be read again.

    Args:
        pipeline: started.
        profile: what the SDK has chosen.
        sdk: the module.
        recording: whether it plays a file.

    Attributes:
        name: of the camera or the file.
        intrinsics: of the colour camera.
        timestamps: seconds of the frames so far, by the SDK's clock.
        ground_truth: None.
        notes: what was assumed.
        rate: None: frames come at their own stamps.
        stopwatch: how long registering each frame took.
    """

    def __init__(self, pipeline: Any, profile: Any, sdk: ModuleType, recording: Path | None = None) -> None:
        self._pipeline, self._sdk, self._is_recording = pipeline, sdk, recording is not None
        device = profile.get_device()
        self._playback = device.as_playback() if self._is_recording else None
        if self._playback is not None:
            self._playback.pause()
        self._scale = float(device.first_depth_sensor().get_depth_scale())
        camera = profile.get_stream(sdk.stream.color).as_video_stream_profile().get_intrinsics()
        title = device.get_info(sdk.camera_info.name) if device.supports(sdk.camera_info.name) else "realsense"
        self.name = printable(title.lower().replace(" ", "-") if recording is None else recording.stem)
        self.notes: list[str] = []
        self.intrinsics = self._intrinsics(camera)
        self.timestamps: list[float] = []
        self.ground_truth: Trajectory | None = None
        self.rate: float | None = None
        self.stopwatch = Stopwatch()
        self._queue = FrameQueue()

    @classmethod
    def open(cls, recording: Path | None = None, record: Path | None = None, mode: CameraMode | None = None) -> Self:
        """Start the first camera that is connected, or a recording of one.

        Args:
            recording: a file that the RealSense viewer or ``record`` wrote; None = a camera.
            record: a file into which the SDK records what the camera sends.
            mode: what the camera is asked for; a recording has its own.

        Raises:
            DatasetError: the package is not installed, there is no camera, or the file cannot be played.
        """
        try:
            import pyrealsense2 as sdk
        except ImportError as error:
            raise DatasetError(
                "A RealSense needs the package pyrealsense2: pip install 'semslam[realsense]'."
            ) from error
        if recording is not None and not recording.is_file():
            raise DatasetError(f"There is no recording {recording}.")
        if recording is None and not len(sdk.context().query_devices()):
            raise DatasetError("There is no RealSense camera: none is connected, or another program is using it.")
        config, mode = sdk.config(), mode or CameraMode()
        if recording is not None:
            config.enable_device_from_file(str(recording), False)
        else:
            config.enable_stream(sdk.stream.color, mode.width, mode.height, sdk.format.rgb8, mode.fps)
            config.enable_stream(sdk.stream.depth, mode.width, mode.height, sdk.format.z16, mode.fps)
        if record is not None:
            config.enable_record_to_file(str(record))
        pipeline = sdk.pipeline()
        try:
            return cls(pipeline, pipeline.start(config), sdk, recording)
        except (RuntimeError, ConfigError) as error:
            what = "camera does not start" if recording is None else f"recording {recording} cannot be played"
            raise DatasetError(f"The {what}: {' '.join(str(error).split())}.") from error

    @property
    def dropped(self) -> tuple[int, ...]:
        """The camera's numbers of frames that it left out, or that nobody took in time."""
        return self._queue.dropped

    def __len__(self) -> int:
        return len(self.timestamps)

    def frame(self, index: int) -> Frame:
        """Frames of a camera come once.

        Raises:
            IndexError: there was no such frame.
            DatasetError: otherwise.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"Frame {index} of {len(self)}.")
        raise DatasetError(f"Frame {index} of {self.name} is gone: those of a camera cannot be read again.")

    def __iter__(self) -> Iterator[Frame]:
        return (arrival.item for arrival in self.arrivals() if isinstance(arrival.item, Frame))

    def arrivals(self) -> Iterator[Arrival]:
        """See ``Feed``; ends with the recording, or never."""
        reader = Thread(target=self._receive, name="semslam-reader", daemon=True)
        reader.start()
        try:
            for arrival in self._queue:
                if isinstance(arrival.item, Frame):
                    frame = replace(arrival.item, index=len(self.timestamps))
                    self.timestamps.append(frame.timestamp)
                    yield Arrival(frame.index, frame, arrival.at)
        finally:
            self._queue.end()
            reader.join()
            self._pipeline.stop()

    def _receive(self) -> None:
        error: BaseException | None = None
        try:
            align = self._sdk.align(self._sdk.stream.color)
            if self._playback is not None:
                self._playback.resume()
            first = last = None
            while not self._queue.ended:
                there, frames = self._pipeline.try_wait_for_frames(END_MS if self._is_recording else SILENCE_MS)
                if not there:
                    error = None if self._is_recording else DatasetError("The camera has stopped sending frames.")
                    return
                number = int(frames.get_color_frame().get_frame_number()) if frames.get_color_frame() else None
                if number is None or not frames.get_depth_frame() or number == last:
                    continue
                first = number if first is None else first
                for missing in range(number if last is None else last + 1, number):
                    self._queue.drop(missing - first)
                last = number
                self._put(number - first, align, frames)
        except BaseException as reason:  # whatever the SDK raises is raised where the next frame would have been taken
            error = reason
        finally:
            self._queue.end(error)

    def _put(self, index: int, align: Any, frames: Any) -> None:
        came = time.perf_counter()
        with self.stopwatch.stage("read"):
            aligned = align.process(frames)
            color, depth = aligned.get_color_frame(), aligned.get_depth_frame()
            frame = Frame(
                index,
                color.get_timestamp() / 1e3,
                np.array(color.get_data(), dtype=np.uint8),
                np.asarray(depth.get_data()).astype(np.float32) * np.float32(self._scale),
                self.intrinsics,
                index,
            )
        self._queue.put(Arrival(index, frame, came))

    def _intrinsics(self, camera: Any) -> Intrinsics:
        coefficients = tuple(float(value) for value in camera.coeffs)
        model = str(camera.model).rpartition(".")[2]
        if any(coefficients) and model not in COEFFICIENTS:
            self.notes.append(
                f"The camera's distortion model '{model}' is not known here; its coefficients are left out."
            )
            coefficients = (0.0,) * len(coefficients)
        sizes = (camera.width, camera.height, camera.fx, camera.fy, camera.ppx, camera.ppy)
        return Intrinsics(*sizes, distortion=coefficients)
