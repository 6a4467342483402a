"""Replays a saved run in a viewer."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

from semslam.datasets.tum_format import read_trajectory
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.loop.segmentation.build import build_segmenter
from semslam.maps.cloud import join_clouds
from semslam.maps.semantic.saved import LabelledMap, read_semantic_map
from semslam.maps.semantic.semantic_map import JSON, PLY
from semslam.runs.manifest import read_manifest
from semslam.runs.recording import RecordedFrame
from semslam.runs.saved_views import Progress, SavedViews, silent
from semslam.system.result import FrameState
from semslam.types import Keyframe, LoopOutcome, Transform
from semslam.viewers.viewer import CameraImage, FinishedRun, KeyframeScene, LoopScene, ShownLoop, Viewer, aligned_truth


def play(saved: SavedViews, viewer: Viewer, progress: Progress = silent) -> None:
    """Show a saved run in a viewer: live poses frame by frame, keyframes' images, and the result.

    The images are read again and labelled by the segmenter of the run's settings.

    Args:
        saved: the run and its images.
        viewer: shows them.
        progress: called with the frames done and in all.

    Raises:
        DatasetError: an image can no longer be read.
        ModelError: the network's weights cannot be used.
    """
    builder = KeyframeBuilder(saved.run.config, details=False)
    segmenter = build_segmenter(saved.run.config)
    loops = defaultdict(list)
    for entry in saved.run.ledger:
        if entry.verdict is not LoopOutcome.SKIPPED:
            verified = entry.verdict is not LoopOutcome.REJECTED
            loops[entry.query].append(ShownLoop(entry.query, entry.match, verified))
    live = _live_poses(saved.run.directory)
    keyframes: list[Keyframe] = []
    for done, recorded in enumerate(saved.recording.frames, start=1):
        if builder.advance(recorded.index, recorded.timestamp, recorded.motion):
            frame = saved.dataset.frame(recorded.index)
            keyframe = builder.build(frame)
            image = CameraImage(frame.color, frame.intrinsics)
            viewer.track(image, _state(recorded, builder.pose.T_odom_cam, live, keyframe.id))
            viewer.keyframe(KeyframeScene.of(keyframe, frame, recorded.motion.observations))
            labels = segmenter.segment(frame.color, frame.depth, frame.source_index)
            viewer.loops(LoopScene.of(keyframe, labels, loops[keyframe.id]))
            keyframes.append(keyframe)
        else:
            viewer.track(None, _state(recorded, builder.pose.T_odom_cam, live, None))
        progress(done, len(saved.recording.frames))
    viewer.finish(lambda: _finished(saved, keyframes))


def has_semantic_map(directory: Path) -> bool:
    """Whether a run folder holds a semantic map (``semslam map RUN --semantic``)."""
    return {PLY, JSON} <= read_manifest(directory).files.keys()


def _semantic_map(directory: Path) -> LabelledMap | None:
    if not has_semantic_map(directory):
        return None
    read_manifest(directory).check(directory, PLY, JSON)
    return read_semantic_map(directory)


def _state(
    recorded: RecordedFrame, T_odom_cam: Transform, live: Mapping[float, Transform], keyframe: int | None
) -> FrameState:
    """A frame as it was when it was done."""
    T_world_cam = live.get(recorded.timestamp, T_odom_cam)
    return FrameState(recorded.index, recorded.timestamp, recorded.motion, T_odom_cam, T_world_cam, keyframe)


def _live_poses(directory: Path) -> dict[float, Transform]:
    """The poses (4, 4) as they stood when each frame was done, by stamp; none of a run that did not keep them."""
    file = directory / "live.txt"
    if not file.exists():
        return {}
    live, _ = read_trajectory(file)
    return dict(zip(live.timestamps.tolist(), live.poses, strict=True))


def _finished(saved: SavedViews, keyframes: Sequence[Keyframe]) -> FinishedRun:
    poses = {keyframe.id: keyframe.T_world_cam for keyframe in saved.keyframes}
    return FinishedRun(
        trajectory=saved.run.trajectory,
        ground_truth=aligned_truth(saved.run.ground_truth, saved.run.trajectory),
        keyframes=poses,
        ledger=saved.run.ledger,
        map=join_clouds([keyframe for keyframe in keyframes if keyframe.id in poses], poses),
        semantic=_semantic_map(saved.run.directory),
    )
