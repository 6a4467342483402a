"""The cache of segmentations."""

import numpy as np

from semslam.config import load_config
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.segmentation.segmenters.cache import CachedSegmenter
from semslam.types import LabelMap


class Counting:
    name = "counting"
    names = ("void", "thing")

    def __init__(self, fingerprint="one", confident=True):
        self.fingerprint, self.confident, self.calls = fingerprint, confident, 0

    def segment(self, color, depth=None, frame_index=None):
        self.calls += 1
        confidence = np.linspace(0, 1, color[..., 0].size, dtype=np.float32).reshape(color.shape[:2])
        return LabelMap((color[..., 0] > 127).astype(np.uint8), self.names, confidence if self.confident else None)


IMAGE = np.random.default_rng(0).integers(0, 255, (12, 16, 3), dtype=np.uint8)


def test_second_answer_comes_from_disk_and_is_the_same(tmp_path):
    inner = Counting()
    cold = CachedSegmenter(inner, tmp_path).segment(IMAGE)
    warm = CachedSegmenter(inner, tmp_path).segment(IMAGE)
    assert inner.calls == 1
    assert np.array_equal(cold.labels, warm.labels)
    assert np.array_equal(cold.confidence, warm.confidence)
    assert np.abs(cold.confidence - Counting().segment(IMAGE).confidence).max() < 0.002
    assert not list(tmp_path.rglob("*.part"))


def test_other_image_shape_or_weights_are_segmented_anew(tmp_path):
    inner = Counting()
    cached = CachedSegmenter(inner, tmp_path)
    for image in (IMAGE, IMAGE ^ 1, IMAGE.reshape(16, 12, 3)):
        cached.segment(image)
    other = Counting("two")
    CachedSegmenter(other, tmp_path).segment(IMAGE)
    assert (inner.calls, other.calls) == (3, 1)


def test_damaged_file_is_made_anew(tmp_path):
    inner = Counting(confident=False)
    cached = CachedSegmenter(inner, tmp_path)
    cached.segment(IMAGE)
    (path,) = tmp_path.rglob("*.npz")
    for damage in (b"", b"torn", path.read_bytes()[:100]):
        path.write_bytes(damage)
        assert cached.segment(IMAGE).confidence is None
    assert inner.calls == 4


def test_what_has_no_fingerprint_is_never_kept(tmp_path):
    inner = Counting(fingerprint="")
    cached = CachedSegmenter(inner, tmp_path)
    cached.segment(IMAGE), cached.segment(IMAGE)
    assert inner.calls == 2
    assert not list(tmp_path.iterdir())


def test_settings_choose_the_cache(tmp_path):
    settings = {"segmentation": {"cache_dir": str(tmp_path)}}
    assert isinstance(build_segmenter(load_config(overrides=settings)), CachedSegmenter)
    assert not isinstance(build_segmenter(load_config()), CachedSegmenter)
