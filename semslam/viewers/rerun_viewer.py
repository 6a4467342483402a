"""A run shown in Rerun (https://rerun.io)."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import cv2
import numpy as np

from semslam.errors import ResultsError
from semslam.eval.looks import ACCEPTED, ODOMETRY, OPTIMISED, OUTCOMES, REJECTED, TRUTH
from semslam.geometry.se3 import Points3, rotations_to_quaternions, transform_points
from semslam.loop.detectors.semantic.nodes import extract_nodes
from semslam.loop.detectors.semantic.settings import NodeConfig
from semslam.loop.segmentation.classes import PALETTE
from semslam.maps.semantic.saved import LabelledMap
from semslam.system.result import FrameState
from semslam.types import (
    Intrinsics,
    LabelMap,
    LedgerEntry,
    LoopOutcome,
    Observations,
    Transform,
)
from semslam.viewers.rerun_blueprint import CAMERA, FINAL, IMAGE, LIVE, TRACKING
from semslam.viewers.viewer import CameraImage, FinishedRun, KeyframeScene, LoopScene, ShownLoop

if TYPE_CHECKING:
    from rerun import RecordingStream

JPEG = [cv2.IMWRITE_JPEG_QUALITY, 75]
PNG_FAST = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE]
MILLIMETRES = 1000.0
PATIENCE = 10.0
"""Seconds that a window may take for what it has not shown yet; one that was closed takes for ever."""
FRUSTUM = 0.25
"""Metres from the camera's centre at which its image is drawn."""
WAITING = 64
"""Keyframes that are kept until their labels come; without a loop detector none come."""
NODES = NodeConfig(min_area=0.005, cluster_radius=0.0)
"""Blocks that are shown as nodes; merging dense ones takes longer than everything else that is shown."""
NODE_STEP = 4
"""Blocks are found in every fourth row and column of the labels, in a third of the time."""


class RerunViewer:
    """Logs a run into a recording.

    Entities lie below ``world/live`` (what is known while the run goes on), ``world/final`` (what came out) and
    ``tracking`` (numbers over time), on the timelines ``frame`` and ``time``.

    Args:
        stream: the open recording.
    """

    def __init__(self, stream: "RecordingStream") -> None:
        self._stream = stream
        self._last: FrameState | None = None
        self._way: list[Points3] = []  # of each frame since it was shown: by odometry alone, with the loops
        self._poses: list[Transform] = []
        self._landmarks: set[int] = set()
        self._unlabelled: dict[int, KeyframeScene] = {}
        self._intrinsics: Intrinsics | None = None
        self._names: tuple[str, ...] | None = None

    def track(self, image: CameraImage | None, state: FrameState) -> None:
        """See ``Viewer``."""
        import rerun as rr

        self._set_time(state.index, state.timestamp)
        T = state.T_world_cam
        self._stream.log(CAMERA, rr.Transform3D(translation=T[:3, 3], mat3x3=T[:3, :3]))
        last, self._last = self._last, state
        if last is not None and last.map_id != state.map_id:
            self._show_way()
            self._way = []
        self._way.append(np.stack([state.T_odom_cam[:3, 3], T[:3, 3]]))
        if state.keyframe is not None:
            self._show_way()
        self._stream.log(f"{TRACKING}/inliers", rr.Scalars(state.motion.inliers))
        if image is not None:
            self._show_camera(image.intrinsics)
            jpeg = cv2.imencode(".jpg", cv2.cvtColor(image.color, cv2.COLOR_RGB2BGR), JPEG)[1].tobytes()
            self._stream.log(f"{IMAGE}/color", rr.EncodedImage(contents=jpeg, media_type="image/jpeg"))

    def keyframe(self, scene: KeyframeScene) -> None:
        """See ``Viewer``."""
        import rerun as rr

        T = scene.T_odom_cam if self._last is None else self._last.T_world_cam
        self._poses.append(T)
        depth = np.rint(scene.depth * MILLIMETRES).clip(0, 65535).astype(np.uint16)
        png = cv2.imencode(".png", depth, PNG_FAST)[1].tobytes()
        self._stream.log(f"{IMAGE}/depth", rr.EncodedDepthImage(blob=png, media_type="image/png", meter=MILLIMETRES))
        cloud = scene.cloud
        self._stream.log(
            f"{LIVE}/cloud",
            rr.Points3D(transform_points(T, cloud.points), colors=cloud.colors, radii=rr.Radius.ui_points(1)),
        )
        if scene.observations is not None:
            self._show_landmarks(scene.observations, scene.intrinsics, T)
        self._unlabelled[scene.id] = scene
        if len(self._unlabelled) > WAITING:
            del self._unlabelled[min(self._unlabelled)]

    def loops(self, scene: LoopScene) -> None:
        """See ``Viewer``."""
        keyframe = self._unlabelled.pop(scene.keyframe, None)
        self._set_time(scene.frame_index, scene.timestamp)
        if scene.labels is not None and keyframe is not None:
            self._show_labels(scene.labels, keyframe, self._poses[scene.keyframe])
        self._show_loops(scene.loops)
        if self._last is not None:
            self._set_time(self._last.index, self._last.timestamp)

    def finish(self, finished: Callable[[], FinishedRun]) -> None:
        """See ``Viewer``."""
        self._show_way()
        self._show_final(finished())

    def _show_final(self, finished: FinishedRun) -> None:
        import rerun as rr

        self._final("trajectory", rr.LineStrips3D([finished.trajectory.poses[:, :3, 3]], colors=_rgb(OPTIMISED.color)))
        if finished.ground_truth is not None:
            self._final(
                "ground_truth", rr.LineStrips3D([finished.ground_truth.poses[:, :3, 3]], colors=_rgb(TRUTH.color))
            )
        places = {key: T[:3, 3] for key, T in finished.keyframes.items()}
        self._final("keyframes", rr.Points3D(list(places.values()), colors=_rgb(OPTIMISED.color), radii=0.02))
        self._final("map", rr.Points3D(finished.map.points, colors=finished.map.colors, radii=rr.Radius.ui_points(1.5)))
        if finished.semantic is not None:
            self._show_semantic(finished.semantic)
        for outcome in LoopOutcome:
            self._final(f"loops/{outcome.value}", _lines(finished.ledger, outcome, places))

    def close(self) -> None:
        """See ``Viewer``.

        Raises:
            ResultsError: the window, or the file, did not take all that was shown.
        """
        try:
            self._stream.flush(timeout_sec=PATIENCE)
        except RuntimeError as error:
            reason = " ".join(str(error).split()).rstrip(".")
            raise ResultsError(
                f"The viewer did not take all of it, as if its window had been closed ({reason})."
            ) from error
        finally:
            self._stream.disconnect()

    def _set_time(self, index: int, timestamp: float) -> None:
        """What is logged next belongs to this frame."""
        self._stream.set_time("frame", sequence=index)
        self._stream.set_time("time", timestamp=timestamp)

    def _final(self, name: str, what: object) -> None:
        self._stream.log(f"{FINAL}/{name}", cast("Any", what), static=True)

    def _show_way(self) -> None:
        """Show the way since it was shown last, by odometry and with the loops known by then."""
        import rerun as rr

        if len(self._way) > 1:
            alone, corrected = np.stack(self._way, axis=1)
            for name, strip, stroke in (("odometry", alone, ODOMETRY), ("path", corrected, OPTIMISED)):
                self._stream.log(f"{LIVE}/{name}", rr.LineStrips3D([strip], colors=_rgb(stroke.color)))
            self._way = self._way[-1:]

    def _show_camera(self, camera: Intrinsics) -> None:
        if camera == self._intrinsics:
            return
        import rerun as rr

        self._intrinsics = camera
        size = (camera.width, camera.height)
        pinhole = rr.Pinhole(image_from_camera=camera.matrix, resolution=size, image_plane_distance=FRUSTUM)
        self._stream.log(IMAGE, pinhole, static=True)
        self._stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Y_DOWN, static=True)

    def _show_landmarks(self, seen: Observations, camera: Intrinsics, T_world_cam: Transform) -> None:
        """Show landmarks where they are seen first."""
        import rerun as rr

        new = np.array([id not in self._landmarks for id in seen.landmarks.tolist()], dtype=bool) & (seen.depths > 0)
        self._landmarks.update(seen.landmarks[new].tolist())
        z = seen.depths[new].astype(np.float64)
        rays = (seen.pixels[new] - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
        points = transform_points(T_world_cam, np.column_stack([rays * z[:, None], z]))
        self._stream.log(f"{LIVE}/landmarks", rr.Points3D(points, colors=(255, 196, 0), radii=rr.Radius.ui_points(2)))
        self._stream.log(f"{TRACKING}/landmarks", rr.Scalars(len(seen.landmarks)))

    def _show_labels(self, labels: LabelMap, keyframe: KeyframeScene, T_world_cam: Transform) -> None:
        import rerun as rr

        self._name_classes(labels.names)
        self._stream.log(f"{IMAGE}/labels", rr.SegmentationImage(labels.labels))
        thinned = np.s_[::NODE_STEP, ::NODE_STEP]
        nodes = extract_nodes(replace(labels, labels=labels.labels[thinned]), keyframe.depth[thinned], NODES)
        uv = nodes.uvd[:, :2] * NODE_STEP
        self._stream.log(f"{IMAGE}/nodes", rr.Points2D(uv, class_ids=nodes.labels, radii=4))
        near = nodes.uvd[:, 2] > 0
        z = nodes.uvd[near, 2:]
        camera = keyframe.intrinsics
        rays = (camera.undistort_pixels(uv[near]) - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
        points = transform_points(T_world_cam, np.column_stack([rays * z, z]))
        self._stream.log(
            f"{LIVE}/nodes", rr.Points3D(points, class_ids=nodes.labels[near], radii=0.03, show_labels=False)
        )

    def _name_classes(self, names: tuple[str, ...]) -> None:
        import rerun as rr

        if self._names != names:
            self._names = names
            colors = PALETTE[np.arange(len(names)) % len(PALETTE)]
            classes = [(i, name, tuple(colors[i].tolist())) for i, name in enumerate(names)]
            self._stream.log("world", rr.AnnotationContext(classes), static=True)

    def _show_semantic(self, semantic: LabelledMap) -> None:
        """Show points by class, and a box with its class around each object."""
        import rerun as rr

        self._name_classes(semantic.names)
        points = rr.Points3D(
            semantic.points, class_ids=semantic.labels, radii=rr.Radius.ui_points(2), show_labels=False
        )
        self._final("semantic", points)
        boxes = semantic.objects
        axes = np.array([box.axes for box in boxes]).reshape(-1, 3, 3)
        self._final(
            "objects",
            rr.Boxes3D(
                centers=[box.centre for box in boxes],
                half_sizes=[box.half for box in boxes],
                quaternions=[rr.Quaternion(xyzw=xyzw) for xyzw in rotations_to_quaternions(axes)],
                class_ids=[box.label for box in boxes],
                labels=[f"{box.name} {box.confidence:.2f}" for box in boxes],
            ),
        )

    def _show_loops(self, loops: Sequence[ShownLoop]) -> None:
        import rerun as rr

        for name, look, verified in (("verified", ACCEPTED, True), ("rejected", REJECTED, False)):
            kept = [loop for loop in loops if loop.verified is verified]
            if kept:
                strips = np.array([[self._poses[key][:3, 3] for key in (loop.match, loop.query)] for loop in kept])
                self._stream.log(f"{LIVE}/loops/{name}", rr.LineStrips3D(strips, colors=_rgb(look.color)))
            self._stream.log(f"{TRACKING}/loops_{name}", rr.Scalars(len(kept)))


def _lines(ledger: Sequence[LedgerEntry], outcome: LoopOutcome, places: dict[int, Transform]) -> object:
    """Lines between the keyframes of all candidates of one outcome, with what is known of each."""
    import rerun as rr

    entries = [e for e in ledger if e.verdict is outcome and e.query in places and e.match in places]
    strips = [np.stack([places[e.match], places[e.query]]) for e in entries]
    labels = [f"{e.match} - {e.query}: {e.reason or e.detector} {e.score:.2f}" for e in entries]
    color = _rgb(OUTCOMES[outcome].color)
    return rr.LineStrips3D(strips, colors=color, labels=labels, show_labels=False)


def _rgb(color: str) -> tuple[int, int, int]:
    """The colour that ``#rrggbb`` names."""
    r, g, b = bytes.fromhex(color[1:])
    return r, g, b
