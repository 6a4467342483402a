"""A tiny made-up folder in the NYUv2 layout."""

import cv2
import numpy as np
import pytest


@pytest.fixture
def rooms(tmp_path):
    """Six photos with a grey wall (1) above a brown floor (2)."""
    folder = tmp_path / "rooms"
    for part in ("rgb", "labels40"):
        (folder / part).mkdir(parents=True)
    rng = np.random.default_rng(0)
    for i in range(6):
        horizon = int(rng.integers(30, 70))
        labels = np.where(np.arange(96)[:, None] < horizon, 1, 2).repeat(128, 1).astype(np.uint8)
        color = np.where(labels[..., None] == 1, (200, 200, 200), (40, 80, 140)) + rng.integers(-20, 20, (96, 128, 3))
        cv2.imwrite(str(folder / "rgb" / f"{i}.png"), color.astype(np.uint8))
        cv2.imwrite(str(folder / "labels40" / f"{i}.png"), labels)
    (folder / "train.txt").write_text("0\n1\n2\n3\n")
    (folder / "val.txt").write_text("4\n5\n")
    return folder
