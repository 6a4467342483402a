"""Procedural textures: square sRGB images (S, S, 3) uint8, tileable unless they show one thing whole.

The grain of wood and of planks runs along u (columns).
"""

from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
Color = tuple[float, float, float]
Field = npt.NDArray[np.float32]

SIZE = 512


def fractal(
    rng: np.random.Generator, falloff: float, stretch: tuple[float, float] = (1.0, 1.0), size: int = SIZE
) -> Field:
    """Tileable noise (size, size) with zero mean and unit deviation.

    Args:
        rng: source of randomness.
        falloff: exponent of the amplitude spectrum; 0 is white, 2 is cloudy.
        stretch: how much longer features are along u and v.
        size: side in texels.
    """
    frequency = np.fft.fftfreq(size) * size
    radius = np.hypot(frequency[:, None] * stretch[1], frequency[None, : size // 2 + 1] * stretch[0])
    spectrum = np.fft.rfft2(rng.standard_normal((size, size), dtype=np.float32)) / np.maximum(radius, 1.0) ** falloff
    spectrum[0, 0] = 0.0
    noise = np.fft.irfft2(spectrum, (size, size))
    return np.asarray(np.clip(noise / noise.std(), -2.5, 2.5), dtype=np.float32)


def _image(values: npt.NDArray[np.floating]) -> Image:
    return np.asarray(np.clip(np.rint(values), 0, 255), dtype=np.uint8)


def _tinted(base: Color, gain: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    return np.asarray(base, dtype=np.float32) * gain[..., None]


def plaster(rng: np.random.Generator, base: Color, strength: float = 1.0) -> Image:
    """Painted wall: faint clouds and a roller's speckle."""
    return _image(_tinted(base, 1 + strength * (0.022 * fractal(rng, 1.4) + 0.018 * fractal(rng, 0.3))))


def wallpaper(rng: np.random.Generator, base: Color, other: Color) -> Image:
    """Vertical stripes with a faint irregular pattern printed on them."""
    u = np.arange(SIZE)
    stripe = 0.5 + 0.5 * np.sin(2 * np.pi * u / SIZE * 8)
    share = np.clip((stripe - 0.5) * 6 + 0.5, 0, 1)[None, :, None]
    image = (1 - share) * np.asarray(base) + share * np.asarray(other)
    return _image(image * (1 + 0.03 * fractal(rng, 0.9)[..., None]))


def wood(rng: np.random.Generator, base: Color, contrast: float = 1.0) -> Image:
    """Grain along u with a few darker veins."""
    body = fractal(rng, 1.3, (1.0, 0.08))
    veins = np.sin(3.0 * fractal(rng, 1.9, (6.0, 1.0)) * np.pi)
    return _image(_tinted(base, 1 + contrast * (0.09 * body + 0.05 * veins + 0.02 * fractal(rng, 0.2))))


def planks(rng: np.random.Generator, base: Color, rows: int = 14) -> Image:
    """Floor boards along u, each of its own tone, dark joints between them."""
    grain = 0.10 * fractal(rng, 1.2, (9.0, 1.0)) + 0.03 * fractal(rng, 0.3)
    gain = np.ones((SIZE, SIZE), dtype=np.float32)
    edges = np.linspace(0, SIZE, rows + 1).astype(int)
    for top, bottom in pairwise(edges):
        cut = int(rng.integers(SIZE))
        tones = 1 + 0.12 * rng.standard_normal(2)
        middle = SIZE // 2 + int(rng.integers(-60, 60))
        row = np.where(np.arange(SIZE) < middle, tones[0], tones[1])
        row[[0, middle]] = 0.55
        gain[top:bottom] = np.roll(row, cut) + np.roll(grain[top:bottom], cut * 3, axis=1)
        gain[top] *= 0.6
    return _image(_tinted(base, gain))


def tiles(rng: np.random.Generator, base: Color, grout: Color, count: int = 6, spread: float = 0.06) -> Image:
    """Square tiles, each of its own tone and marbling, with joints."""
    cell = np.minimum(np.arange(SIZE) * count // SIZE, count - 1)
    tone = 1 + spread * rng.standard_normal((count, count))
    gain = tone[cell[:, None], cell[None, :]] + 0.04 * fractal(rng, 1.5)
    image = _tinted(base, gain)
    place = (np.arange(SIZE) * count) % SIZE
    joint = (place < 5 * count)[:, None] | (place < 5 * count)[None, :]
    image[joint] = np.asarray(grout) * (1 + 0.05 * rng.standard_normal((int(joint.sum()), 1)))
    return _image(image)


def brick(rng: np.random.Generator, base: Color, mortar: Color, rows: int = 12) -> Image:
    """Running bond, each brick of its own tone."""
    image = np.empty((SIZE, SIZE, 3), dtype=np.float32)
    image[:] = mortar
    columns = rows // 3
    height, width = SIZE / rows, SIZE / columns
    for row in range(rows):
        for column in range(columns):
            left = (column + 0.5 * (row % 2)) * width
            tone = np.asarray(base) * (1 + 0.13 * rng.standard_normal() + 0.04 * rng.standard_normal(3))
            rows_of = slice(int(row * height) + 3, int((row + 1) * height))
            u = np.arange(int(left) + 3, int(left + width)) % SIZE
            image[rows_of, u] = tone
    return _image(image * (1 + 0.06 * fractal(rng, 0.8)[..., None]))


def fabric(rng: np.random.Generator, base: Color, contrast: float = 1.0) -> Image:
    """Woven cloth with lint and worn patches."""
    u = np.arange(SIZE)
    weave = np.sin(2 * np.pi * u / 8)[:, None] * np.sin(2 * np.pi * u / 8)[None, :]
    gain = 1 + contrast * (0.05 * fractal(rng, 1.4) + 0.05 * fractal(rng, 0.4) + 0.03 * weave)
    return _image(_tinted(base, gain))


def patterned(rng: np.random.Generator, base: Color, other: Color, count: int = 7) -> Image:
    """Cloth with scattered leaves and dots, for cushions, quilts and curtains."""
    image = fabric(rng, base).astype(np.uint8)
    for _ in range(count * count):
        centre = tuple(int(c) for c in rng.integers(0, SIZE, 2))
        axes = (int(rng.integers(10, 34)), int(rng.integers(4, 14)))
        tone = tuple(float(c) for c in np.asarray(other) * rng.uniform(0.8, 1.15))
        for shift in np.ndindex(3, 3):
            place = (centre[0] + (shift[0] - 1) * SIZE, centre[1] + (shift[1] - 1) * SIZE)
            cv2.ellipse(image, place, axes, float(centre[0]), 0, 360, tone, -1, cv2.LINE_AA)
    return image


def rug(rng: np.random.Generator, colors: tuple[Color, Color, Color]) -> Image:
    """A whole rug: borders, medallion and scattered knots."""
    image = np.empty((SIZE, SIZE, 3), dtype=np.uint8)
    image[:] = colors[0]
    for inset, index in ((14, 1), (34, 2), (58, 0), (64, 1), (72, 0)):
        cv2.rectangle(image, (inset, inset), (SIZE - inset, SIZE - inset), colors[index], -1)
    for radius, index in ((150, 1), (120, 2), (80, 0), (44, 1)):
        turn = float(rng.uniform(0, 90))
        box = cv2.boxPoints(((SIZE / 2, SIZE / 2), (radius * 2.0, radius * 1.4), turn))
        cv2.fillPoly(image, [box.astype(np.int32)], colors[index], cv2.LINE_AA)
    for _ in range(140):
        x, y = (int(c) for c in rng.integers(80, SIZE - 80, 2))
        color = colors[int(rng.integers(3))]
        cv2.circle(image, (x, y), int(rng.integers(3, 10)), color, -1, cv2.LINE_AA)
    return _image(image * (1 + 0.07 * fractal(rng, 0.4)[..., None]))


def stone(rng: np.random.Generator, base: Color) -> Image:
    """Worktop with veins and grains."""
    veins = np.exp(-(np.abs(fractal(rng, 1.6)) ** 0.7) * 6)
    return _image(_tinted(base, 1 - 0.35 * veins + 0.07 * fractal(rng, 0.5)))


def leaves(rng: np.random.Generator) -> Image:
    """Foliage."""
    image = np.empty((SIZE, SIZE, 3), dtype=np.uint8)
    image[:] = (30, 52, 24)
    for _ in range(500):
        centre = tuple(int(c) for c in rng.integers(0, SIZE, 2))
        green = tuple(float(c) for c in np.array([62, 108, 44]) * rng.uniform(0.5, 1.5))
        axes = (int(rng.integers(14, 40)), int(rng.integers(5, 12)))
        cv2.ellipse(image, centre, axes, float(rng.uniform(0, 180)), 0, 360, green, -1, cv2.LINE_AA)
    return image


def door(rng: np.random.Generator, base: Color) -> Image:
    """A whole panelled door leaf."""
    image = np.ascontiguousarray(wood(rng, base, 0.5).transpose(1, 0, 2))
    for top, bottom in ((0.06, 0.42), (0.50, 0.93)):
        for left, right in ((0.13, 0.46), (0.54, 0.87)):
            low = (int(left * SIZE), int(top * SIZE))
            high = (int(right * SIZE), int(bottom * SIZE))
            cv2.rectangle(image, low, high, tuple(0.72 * c for c in base), 7)
            cv2.rectangle(image, (low[0] + 9, low[1] + 9), high, tuple(min(255.0, 1.1 * c) for c in base), 3)
    return image
