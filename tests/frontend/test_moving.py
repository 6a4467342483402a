"""What moves is found by free space alone, and left out of tracking and of keyframes."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from semslam.config import Config
from semslam.datasets.synthetic import Request, SyntheticDataset, labels
from semslam.eval.trajectory import score_trajectory
from semslam.frontend.feature_map.odometry import FeatureMapOdometry
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.frontend.moving.movers import FreeSpaceMovers, standing_at
from semslam.geometry.se3 import compose
from semslam.types import Frame, Trajectory

PERSON = SyntheticDataset("room", Request(people=1))
FIRST, LAST = 18, 34
"""Frames in which the person comes into view and crosses it."""
COUNTING_IN = Config().with_changes(dynamics={"free_space": False})


@lru_cache(maxsize=LAST)
def frame(index: int) -> Frame:
    return PERSON.frame(index)


def small(people: int) -> SyntheticDataset:
    return SyntheticDataset("room", Request(people=people, width=160))


def ate(config: Config) -> float:
    """Of the causal poses, metres."""
    odometry = FeatureMapOdometry.from_config(config)
    frames = [frame(index) for index in range(FIRST, LAST)]
    poses = compose([odometry.track(each).T_prev_cur for each in frames][1:], np.eye(4))
    stamps = np.array([each.timestamp for each in frames])
    error = score_trajectory(Trajectory(stamps, poses), PERSON.ground_truth).ate_rmse_m
    assert error is not None
    return error


def test_a_crossing_person_does_not_pull_the_camera_along() -> None:
    assert ate(Config()) < 0.5 * ate(COUNTING_IN)


def test_a_person_is_found_and_nothing_else() -> None:
    dataset, movers = small(people=1), FreeSpaceMovers()
    found, person = [], []
    for index in range(16, 31):
        seen = dataset.frame(index)
        standing = standing_at(movers, seen, dataset.ground_truth.poses[index])
        found.append((standing.depth == 0) & (seen.depth > 0))
        person.append((dataset.labels(index) == labels.PERSON) & (seen.depth > 0))
        assert np.array_equal(standing.depth[~found[-1]], seen.depth[~found[-1]])
    recall, precision = (np.logical_and(found, person).sum() / np.sum(of) for of in (person, found))
    assert recall > 0.7
    assert precision > 0.9


def test_where_nothing_moves_nothing_is_found() -> None:
    dataset, movers = small(people=0), FreeSpaceMovers()
    for index in range(40, 60, 2):
        seen = dataset.frame(index)
        assert standing_at(movers, seen, dataset.ground_truth.poses[index]) is seen


def test_a_change_between_two_maps_is_no_motion() -> None:
    dataset, movers = small(people=1), FreeSpaceMovers()
    standing_at(movers, dataset.frame(16), dataset.ground_truth.poses[16], map_id=0)
    seen = dataset.frame(26)
    assert standing_at(movers, seen, dataset.ground_truth.poses[26], map_id=1) is seen


@pytest.mark.parametrize("depth", [0.0, np.nan])
def test_frames_without_depth_are_as_they_were(depth: float) -> None:
    seen, movers = small(people=1).frame(20), FreeSpaceMovers()
    blind = Frame(20, seen.timestamp, seen.color, np.full_like(seen.depth, depth), seen.intrinsics)
    for _ in range(2):
        assert standing_at(movers, blind, np.eye(4)) is blind
    assert standing_at(movers, seen, np.eye(4), is_sure=False) is seen


def test_keyframes_hold_no_person() -> None:
    on_person = {}
    for name, config in (("left out", Config()), ("as seen", COUNTING_IN)):
        builder = KeyframeBuilder(config, details=False)
        for index in range(FIRST, LAST, 3):
            keyframe = builder.build_at(frame(index), PERSON.ground_truth.poses[index])
        camera = keyframe.intrinsics
        person = PERSON.labels(index) == labels.PERSON
        u, v = np.rint(camera.project(keyframe.cloud.points)).astype(int).T
        x, y = np.rint(keyframe.features.pixels).astype(int).T
        on_person[name] = np.array([person[v, u].sum(), person[y, x].sum()])
    assert (on_person["as seen"] > 20).all()
    assert (on_person["left out"] < 0.2 * on_person["as seen"]).all()


def test_rows_that_are_read_out_during_a_fast_turn_are_no_motion() -> None:
    rolling = SyntheticDataset("room", Request(readout=0.06, depth_readout=0.06, sway=20.0, rate=30, width=160))
    stated = rolling.intrinsics
    found = {}
    for camera in (stated, replace(stated, readout=0.0, depth_readout=0.0)):
        movers, found[camera] = FreeSpaceMovers(), 0
        for index in range(50):
            seen = replace(rolling.frame(index), intrinsics=camera)
            found[camera] += standing_at(movers, seen, rolling.ground_truth.poses[index]) is not seen
    assert found[stated] == 0
    assert max(found.values()) > 5


def test_what_moves_is_found_through_a_lens_with_distortion() -> None:
    dataset, movers = small(people=1), FreeSpaceMovers()
    for index in range(16, 26):
        seen = dataset.frame(index)
        # The rays change by less than a cell, the way to the pixels is another one.
        lens = replace(seen.intrinsics, distortion=(1e-4, 0.0, 0.0, 0.0, 0.0))
        standing = standing_at(movers, replace(seen, intrinsics=lens), dataset.ground_truth.poses[index])
    found, person = standing.depth == 0, dataset.labels(index) == labels.PERSON
    assert (found & person).sum() > 0.7 * (person & (seen.depth > 0)).sum()


def test_a_wrong_pose_is_no_motion() -> None:
    dataset, movers = small(people=0), FreeSpaceMovers()
    for index in range(0, 120, 8):
        seen = dataset.frame(index)
        assert standing_at(movers, seen, np.eye(4), is_sure=False) is seen


def test_what_changed_long_ago_is_no_motion() -> None:
    dataset, movers = small(people=1), FreeSpaceMovers()
    poses = dataset.ground_truth.poses
    standing_at(movers, dataset.frame(16), poses[16])
    later = replace(dataset.frame(24), timestamp=dataset.timestamps[16] + 4.0)
    assert standing_at(movers, later, poses[24]) is later
    movers = FreeSpaceMovers()
    standing_at(movers, dataset.frame(16), poses[16])
    soon = dataset.frame(24)
    assert standing_at(movers, soon, poses[24]) is not soon
