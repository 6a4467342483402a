"""What every segmenter promises."""

from typing import ClassVar

import cv2
import numpy as np
import pytest

from semslam.config import Config
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.testing.settings import check_settings
from semslam.types import UInt8Array


class SegmenterContract:
    """Inherit from it and name the class under test.

    Attributes:
        implementation: the segmenter.
        config: settings to build it from.
    """

    implementation: ClassVar[type[Segmenter]]
    config: ClassVar[Config] = Config()

    def make(self) -> Segmenter:
        """A fresh segmenter."""
        return self.implementation.from_config(self.config)

    def test_it_fills_the_role(self) -> None:
        """It has every member; the first class is "void"."""
        segmenter = self.make()
        assert isinstance(segmenter, Segmenter)
        assert segmenter.name
        assert segmenter.names[0] == "void"
        assert len(set(segmenter.names)) == len(segmenter.names)
        assert isinstance(segmenter.fingerprint, str)
        check_settings(self.implementation)

    @pytest.mark.parametrize("shape", [(120, 160), (97, 131)])
    def test_labels_have_the_size_of_the_image(self, shape: tuple[int, int]) -> None:
        """Labels and confidences of every pixel, within the classes and within 0..1."""
        segmenter = self.make()
        found = segmenter.segment(_image(*shape), frame_index=0)
        assert found.labels.shape == shape
        assert found.labels.dtype == np.uint8
        assert found.labels.max() < len(segmenter.names)
        assert found.names == segmenter.names
        if found.confidence is not None:
            assert found.confidence.shape == shape
            assert found.confidence.dtype == np.float32
            assert ((found.confidence >= 0) & (found.confidence <= 1)).all()

    def test_the_same_image_gives_the_same_labels(self) -> None:
        """Twice the same image: twice the same labels, and the image is left as it is."""
        segmenter, image = self.make(), _image(120, 160)
        kept = image.copy()
        first, again = (segmenter.segment(image, frame_index=0) for _ in range(2))
        assert np.array_equal(first.labels, again.labels)
        assert np.array_equal(image, kept)


def _image(height: int, width: int) -> UInt8Array:
    coarse = np.random.default_rng(0).integers(0, 255, (height // 8, width // 8, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
