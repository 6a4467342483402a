"""Every registered segmenter keeps the contract."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam import plugins
from semslam.config import Config
from semslam.testing import SegmenterContract


class TestSegmenter(SegmenterContract):
    @pytest.fixture(autouse=True, params=plugins.names("semslam.segmenters"))
    def choose(self, request: pytest.FixtureRequest, tmp_path: Path) -> None:
        for i in range(3):
            cv2.imwrite(str(tmp_path / f"{i:06d}.png"), np.full((24, 32), i + 1, np.uint8))
        self.implementation = plugins.load("semslam.segmenters", request.param)
        self.config = Config().with_changes(segmentation={"name": request.param, "labels_dir": tmp_path})
        assert self.implementation.name == request.param
