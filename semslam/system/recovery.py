"""Every frame's pose from the optimised keyframes around it."""

from collections.abc import Mapping, Sequence

import numpy as np

from semslam.geometry.se3 import FloatArray, Transform, interpolate, invert, orthonormalise
from semslam.types import IntArray, Keyframe


def recover_poses(
    timestamps: FloatArray,
    T_odom_cam: Transform,
    map_ids: IntArray,
    keyframes: Sequence[Keyframe],
    optimized: Mapping[int, Transform],
) -> FloatArray:
    """Bend the odometry between keyframes so that it meets their optimised poses.

    Each keyframe defines a correction of the odometry, T_world_odom. A frame between two keyframes of its map is
    placed by both corrections and lies between the two places by its time; one outside them follows the nearest.

    Args:
        timestamps: (N,) seconds of the frames, ascending.
        T_odom_cam: (N, 4, 4) odometry poses of the frames.
        map_ids: (N,) the odometry's map of each frame.
        keyframes: in ascending time.
        optimized: T_world_cam (4, 4) by keyframe id.

    Returns:
        (N, 4, 4) T_world_cam; frames of a map without keyframes keep their odometry pose.
    """
    poses = T_odom_cam.copy()
    for map_id in np.unique(map_ids):
        inside = [keyframe for keyframe in keyframes if keyframe.map_id == map_id]
        if not inside:
            continue
        stamps = np.array([keyframe.timestamp for keyframe in inside])
        corrections = np.stack([optimized[k.id] @ invert(k.T_odom_cam) for k in inside])
        for i in np.flatnonzero(map_ids == map_id):
            after = int(np.searchsorted(stamps, timestamps[i]).clip(1, len(stamps) - 1)) if len(stamps) > 1 else 0
            before = max(after - 1, 0)
            span = stamps[after] - stamps[before]
            share = float(np.clip((timestamps[i] - stamps[before]) / span, 0.0, 1.0)) if span > 0 else 0.0
            poses[i] = interpolate(corrections[before] @ T_odom_cam[i], corrections[after] @ T_odom_cam[i], share)
    return orthonormalise(poses)
