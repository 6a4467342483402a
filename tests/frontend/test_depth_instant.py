"""Depth that is taken after colour, at colour's instant again."""

from dataclasses import replace

import numpy as np
import pytest

from semslam.config import KeypointConfig
from semslam.datasets.synthetic import Request, SyntheticDataset
from semslam.features import FeatureExtractor
from semslam.frontend.depth_instant import at_color
from semslam.frontend.rolling_shutter import velocity_of
from semslam.geometry.se3 import invert
from semslam.types import FloatArray, Frame

CONFIG = KeypointConfig()
INDEX = 20


def frame_of(**switches: object) -> Frame:
    return SyntheticDataset("room", Request(noise=False, **switches)).frame(INDEX)


@pytest.fixture(scope="module")
def velocity() -> FloatArray:
    poses = SyntheticDataset("room", Request(rate=100)).ground_truth.poses
    return velocity_of(invert(poses[10 * INDEX - 1]) @ poses[10 * INDEX + 1], 0.02)


@pytest.mark.parametrize(("delay", "depth_readout"), [(0.02, 0.0), (-0.02, 0.0), (0.01, 0.03)])
def test_depth_is_that_of_colours_instant(delay: float, depth_readout: float, velocity: FloatArray) -> None:
    truth = FeatureExtractor(CONFIG).extract(frame_of())
    frame = frame_of(delay=delay, depth_readout=depth_readout)
    frame = replace(frame, intrinsics=replace(frame.intrinsics, delay=delay, depth_readout=depth_readout))
    late = FeatureExtractor(CONFIG).extract(frame)
    found = at_color(late, frame, velocity, 0.0, CONFIG)
    assert np.array_equal(found.pixels, truth.pixels)
    seen = (truth.depths > 0) & (found.depths > 0)
    assert seen.mean() > 0.9
    before, after = (np.abs(features.depths - truth.depths)[seen] for features in (late, found))
    assert np.median(after) < 0.5 * np.median(before)
    assert np.allclose(found.points[:, 2], found.depths)


def test_one_instant_changes_nothing(velocity: FloatArray) -> None:
    frame = frame_of()
    features = FeatureExtractor(CONFIG).extract(frame)
    assert at_color(features, frame, velocity, 0.0, CONFIG) is features
    rolling = replace(frame, intrinsics=replace(frame.intrinsics, readout=0.026, depth_readout=None))
    assert at_color(features, rolling, velocity, 0.026, CONFIG) is features


def test_a_camera_at_rest_changes_no_depth() -> None:
    frame = frame_of()
    frame = replace(frame, intrinsics=replace(frame.intrinsics, delay=0.02))
    features = FeatureExtractor(CONFIG).extract(frame)
    found = at_color(features, frame, np.zeros(6), 0.0, CONFIG)
    assert np.allclose(found.depths, features.depths)
