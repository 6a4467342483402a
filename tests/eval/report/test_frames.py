"""Images on a page: small, within a budget, the doubtful loops' first."""

from dataclasses import replace

import numpy as np

from semslam.eval.report.frames import KeyframeImage, LabelColor, embed_images
from semslam.types import LoopJudgement
from tests.eval.report.ledgers import REJECTED, judged

IMAGE = np.tile(np.arange(64, dtype=np.uint8)[None, :, None], (48, 1, 3))


def read(frame: int) -> KeyframeImage | None:
    return KeyframeImage(IMAGE, IMAGE // 64, (LabelColor("wall", "#ff0000", 0.5),))


def test_both_frames_of_every_candidate_are_embedded_once() -> None:
    images = embed_images([REJECTED, judged(LoopJudgement.TRUE)], read)
    assert set(images.by_keyframe) == {40, 3}
    assert not images.limited
    one = images.by_keyframe[40]
    assert (one.width, one.height) == (64, 48)
    assert one.image.startswith("data:image/jpeg;base64,")
    assert one.mask is not None and one.mask.startswith("data:image/png;base64,")


def test_a_budget_leaves_out_the_least_wanted_and_says_so() -> None:
    loops = [replace(REJECTED, query=i + 100, match=i, query_frame=i + 100, match_frame=i) for i in range(20)]
    loops.append(replace(judged(LoopJudgement.FALSE), query=900, match=901))
    size = embed_images(loops[:1], read).by_keyframe[0].size
    images = embed_images(loops, read, budget=4 * size)
    assert images.limited
    assert {900, 901} <= set(images.by_keyframe)
    assert sum(image.size for image in images.by_keyframe.values()) <= 4 * size


def test_frames_that_cannot_be_read_are_left_out() -> None:
    assert embed_images([REJECTED], lambda frame: None).by_keyframe == {}
