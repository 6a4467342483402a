"""Procedural images that show one thing whole: paintings, posters, book spines, screens, window views."""

import cv2
import numpy as np
import numpy.typing as npt

from semslam.datasets.synthetic.textures import SIZE, Color, Image, fractal

LETTERS = "ABCDEFGHIKLMNOPRSTUVWXYZ"


def _tuple(color: npt.NDArray[np.floating]) -> Color:
    r, g, b = (float(c) for c in np.clip(color, 0, 255))
    return r, g, b


def palette(rng: np.random.Generator, count: int) -> list[Color]:
    """Colours that go together: a few hues at spread values."""
    hues = (rng.integers(180) + np.array([0, 12, 90, 150])) % 180
    hsv = np.stack([rng.choice(hues, count), rng.integers(40, 190, count), np.linspace(50, 235, count).astype(int)], -1)
    rng.shuffle(hsv)
    rgb = cv2.cvtColor(hsv[None].astype(np.uint8), cv2.COLOR_HSV2RGB)[0]
    return [_tuple(c) for c in rgb]


def landscape(rng: np.random.Generator) -> Image:
    """A painting of hills, trees and a sky."""
    colors = palette(rng, 6)
    v = np.linspace(0, 1, SIZE)[:, None, None]
    sky = (1 - v) * np.array([110, 150, 205]) + v * np.array([236, 214, 184])
    image = np.asarray(np.clip(sky + 14 * fractal(rng, 1.6, (3.0, 1.0))[..., None], 0, 255), dtype=np.uint8)
    cv2.circle(image, (int(rng.integers(80, 430)), int(rng.integers(60, 180))), 34, (250, 236, 190), -1, cv2.LINE_AA)
    u = np.arange(SIZE)
    for depth in range(4):
        ridge = 200 + 75 * depth + 40 * np.cumsum(rng.standard_normal(SIZE)) / 20
        ridge += 30 * np.sin(u / rng.uniform(40, 120) + rng.uniform(0, 6))
        outline = np.concatenate([np.stack([u, ridge], -1), [[SIZE, SIZE], [0, SIZE]]]).astype(np.int32)
        tone = np.array(colors[depth]) * 0.5 + np.array([60, 90, 50]) * (0.9 - 0.15 * depth)
        cv2.fillPoly(image, [outline], _tuple(tone))
        for _ in range(6 + 4 * depth):
            x = int(rng.integers(SIZE))
            y = int(ridge[x])
            height = int(rng.integers(14, 26) * (1 + depth))
            crown = _tuple(np.array([40, 66, 36]) * rng.uniform(0.6, 1.4))
            cv2.line(image, (x, y + 4), (x, y - height), (52, 40, 30), 2 + depth)
            cv2.ellipse(image, (x, y - height), (height // 3, height // 2), 0, 0, 360, crown, -1, cv2.LINE_AA)
    return np.asarray(np.clip(image + 7 * fractal(rng, 0.6)[..., None], 0, 255), dtype=np.uint8)


def abstract(rng: np.random.Generator) -> Image:
    """A painting of blocks, discs and strokes."""
    colors = palette(rng, 7)
    image = np.empty((SIZE, SIZE, 3), dtype=np.uint8)
    image[:] = colors[0]
    for _ in range(26):
        color = colors[int(rng.integers(len(colors)))]
        a = tuple(int(c) for c in rng.integers(0, SIZE, 2))
        b = tuple(int(c) for c in np.asarray(a) + rng.integers(-170, 170, 2))
        kind = int(rng.integers(3))
        if kind == 0:
            cv2.rectangle(image, a, b, color, -1)
        elif kind == 1:
            cv2.circle(image, a, int(rng.integers(12, 70)), color, -1, cv2.LINE_AA)
        else:
            cv2.line(image, a, b, color, int(rng.integers(4, 20)), cv2.LINE_AA)
    return np.asarray(np.clip(image + 9 * fractal(rng, 0.7)[..., None], 0, 255), dtype=np.uint8)


def poster(rng: np.random.Generator) -> Image:
    """A printed sheet: a title, an abstract figure and lines of text."""
    image = np.empty((SIZE, SIZE, 3), dtype=np.uint8)
    image[:] = _tuple(np.array([238, 234, 224]) * rng.uniform(0.9, 1.0))
    ink = palette(rng, 5)
    image[120:360, 40:472] = cv2.resize(abstract(rng), (432, 240), interpolation=cv2.INTER_AREA)
    title = "".join(rng.choice(list(LETTERS), 7))
    cv2.putText(image, title, (36, 92), cv2.FONT_HERSHEY_DUPLEX, 2.6, ink[0], 8, cv2.LINE_AA)
    for line in range(4):
        text = "".join(rng.choice([*LETTERS, " ", " "], 22))
        cv2.putText(image, text, (40, 398 + 30 * line), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (40, 38, 36), 2, cv2.LINE_AA)
    return image


def spines(rng: np.random.Generator, count: int = 32) -> Image:
    """Book spines side by side, ``count`` of equal width: bands, titles, wear."""
    image = np.empty((SIZE, SIZE, 3), dtype=np.uint8)
    width = SIZE // count
    for k in range(count):
        hsv = np.array([[[rng.integers(180), rng.integers(30, 210), rng.integers(45, 225)]]], dtype=np.uint8)
        cover = cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB)[0, 0].astype(np.float64)
        ink = _tuple(cover * 0.3 if cover.mean() > 120 else cover * 0.3 + 175)
        left, right = k * width, (k + 1) * width - 1
        cv2.rectangle(image, (left, 0), (right, SIZE), _tuple(cover), -1)
        for band in rng.choice([30, 60, 400, 440, 480], 2, replace=False):
            cv2.rectangle(image, (left, int(band)), (right, int(band) + int(rng.integers(6, 22))), ink, -1)
        y = 110
        while y < 360:
            step = int(rng.integers(8, 30))
            inset = int(rng.integers(3, 6))
            cv2.rectangle(image, (left + inset, y), (right - inset, y + step), ink, -1)
            y += step + int(rng.integers(5, 18))
    return np.asarray(np.clip(image * (1 + 0.05 * fractal(rng, 0.8)[..., None]), 0, 255), dtype=np.uint8)


def view(rng: np.random.Generator) -> Image:
    """What is seen through a window: a bright sky over blurred trees and roofs."""
    v = np.linspace(0, 1, SIZE)[:, None, None]
    image = np.asarray((1 - v) * np.array([205, 224, 245]) + v * np.array([240, 243, 240]), dtype=np.uint8)
    image = np.ascontiguousarray(np.broadcast_to(image, (SIZE, SIZE, 3)))
    for _ in range(4):
        x = int(rng.integers(SIZE))
        wall = _tuple(np.array([196, 176, 160]) * rng.uniform(0.85, 1.1))
        cv2.rectangle(image, (x, int(rng.integers(290, 340))), (x + 130, SIZE), wall, -1)
    for _ in range(60):
        centre = (int(rng.integers(SIZE)), int(rng.integers(360, SIZE)))
        green = _tuple(np.array([128, 158, 112]) * rng.uniform(0.7, 1.2))
        cv2.circle(image, centre, int(rng.integers(18, 60)), green, -1, cv2.LINE_AA)
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 3.0), dtype=np.uint8)


def screen(rng: np.random.Generator, lit: bool) -> Image:
    """A display: dark with a faint reflection, or showing windows of text."""
    image = np.empty((SIZE, SIZE, 3), dtype=np.uint8)
    image[:] = (22, 24, 28)
    if not lit:
        cv2.fillPoly(image, [np.array([[60, 0], [190, 0], [90, SIZE], [0, SIZE], [0, 160]], np.int32)], (38, 41, 46))
        return np.asarray(cv2.GaussianBlur(image, (0, 0), 6.0), dtype=np.uint8)
    image[:] = (70, 92, 128)
    for left, top in ((30, 40), (250, 120)):
        cv2.rectangle(image, (left, top), (left + 230, top + 300), (236, 236, 232), -1)
        cv2.rectangle(image, (left, top), (left + 230, top + 22), (90, 98, 112), -1)
        for line in range(14):
            length = int(rng.integers(40, 200))
            cv2.line(
                image, (left + 14, top + 44 + 18 * line), (left + 14 + length, top + 44 + 18 * line), (70, 74, 84), 5
            )
    return image


def carton(rng: np.random.Generator, base: Color) -> Image:
    """A cardboard box's side with tape and a label."""
    grain = fractal(rng, 0.9, (1.0, 8.0))
    image = np.asarray(np.clip(np.asarray(base) * (1 + 0.06 * grain[..., None]), 0, 255), dtype=np.uint8)
    cv2.rectangle(image, (0, 230), (SIZE, 282), _tuple(np.asarray(base) * 0.82), -1)
    cv2.rectangle(image, (300, 320), (470, 450), (240, 238, 230), -1)
    text = "".join(rng.choice(list(LETTERS), 5))
    cv2.putText(image, text, (40, 170), cv2.FONT_HERSHEY_DUPLEX, 3.0, (60, 46, 34), 9, cv2.LINE_AA)
    cv2.putText(image, text[:3], (318, 400), cv2.FONT_HERSHEY_SIMPLEX, 2.0, (40, 40, 40), 5, cv2.LINE_AA)
    return image
