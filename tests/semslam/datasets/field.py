"""Small folders of images, for tests of what people bring from the field."""

from pathlib import Path

import cv2
import numpy as np

CAMERA = "width: 64\nheight: 48\nfx: 60\nfy: 60\ncx: 31.5\ncy: 23.5\n"
EPOCH_NS = 1622548800 * 10**9


def write_pair(color: Path, depth: Path, value: int, raw: np.ndarray | None = None) -> None:
    for file in (color, depth):
        file.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(color), np.full((48, 64, 3), value, np.uint8))
    assert cv2.imwrite(str(depth), np.full((48, 64), 1900, np.uint16) if raw is None else raw)


def write_named(folder: Path, color: list[str], depth: list[str], camera: str = CAMERA) -> Path:
    """Colour image i is grey of value i; all depth is 1900."""
    for i, name in enumerate(color):
        write_pair(folder / "color" / name, folder / "depth" / "x.png", i)
    (folder / "depth" / "x.png").unlink()
    for name in depth:
        cv2.imwrite(str(folder / "depth" / name), np.full((48, 64), 1900, np.uint16))
    (folder / "camera.yaml").write_text(camera + "depth_scale: 1000\n")
    return folder


def greys(dataset: object) -> list[int]:
    return [int(frame.color[0, 0, 0]) for frame in dataset]  # type: ignore[attr-defined]
