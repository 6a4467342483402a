"""What every implementation of a role promises, as pytest classes to inherit from (needs pytest: ``semslam[test]``).

from semslam.testing import DetectorContract


class TestMyDetector(DetectorContract):
    implementation = MyDetector

Everything runs on scenes that are rendered or drawn at random, so nothing has to be downloaded.
"""

import pytest

ROLES = ("dataset", "detector", "odometry", "robust", "segmenter", "verifier")
pytest.register_assert_rewrite(*(f"{__name__}.{role}" for role in ROLES))

from semslam.testing.dataset import DatasetContract
from semslam.testing.detector import DetectorContract
from semslam.testing.odometry import OdometryContract
from semslam.testing.robust import RobustContract
from semslam.testing.segmenter import SegmenterContract
from semslam.testing.verifier import VerifierContract

__all__ = [
    "DatasetContract",
    "DetectorContract",
    "OdometryContract",
    "RobustContract",
    "SegmenterContract",
    "VerifierContract",
]
