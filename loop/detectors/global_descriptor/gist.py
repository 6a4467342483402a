"""The gist of a scene (Oliva and Torralba, IJCV 2001): where in the image which spatial frequencies are strong."""

from functools import lru_cache
from typing import Self

import cv2
import numpy as np

from semslam.config import Config
from semslam.loop.detectors.global_descriptor.descriptor import DescriptorDetector
from semslam.types import Float32Array, KeyframeView

SIDE = 128
ORIENTATIONS = (8, 8, 8, 8)
"""Filters at each scale, finest first."""
GRID = 4
CONTRAST_CYCLES = 4.0
"""Cycles per image below which brightness and contrast are evened out."""
MIN_SCORE = 0.92


class GistDetector(DescriptorDetector):
    """Energies of 32 Gabor filters on a 4 x 4 grid, (512,), after local contrast is evened out."""

    name = "gist"

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the section ``loops``."""
        return cls(config.loops, MIN_SCORE)

    def describe(self, view: KeyframeView) -> Float32Array:
        """Mean filter energy in each field of the grid."""
        gray = cv2.cvtColor(view.color, cv2.COLOR_RGB2GRAY)
        small = cv2.resize(gray, (SIDE, SIDE), interpolation=cv2.INTER_AREA).astype(np.float32)
        spectrum = np.fft.fft2(_even_contrast(small))
        energy = np.abs(np.fft.ifft2(spectrum * _filters())).astype(np.float32)
        fields = energy.reshape(-1, GRID, SIDE // GRID, GRID, SIDE // GRID).mean(axis=(2, 4))
        return np.asarray(fields.ravel(), dtype=np.float32)


def _even_contrast(gray: Float32Array) -> Float32Array:
    log = np.log1p(gray)
    sigma = SIDE / (2 * np.pi * CONTRAST_CYCLES) * np.sqrt(np.log(2.0))
    detail = log - cv2.GaussianBlur(log, (0, 0), sigma)
    contrast = np.sqrt(np.abs(cv2.GaussianBlur(detail**2, (0, 0), sigma)))
    return np.asarray(detail / (0.2 + contrast), dtype=np.float32)


@lru_cache(maxsize=1)
def _filters() -> Float32Array:
    """(filters, SIDE, SIDE) transfer functions in the order of the FFT: log-radial times angular Gaussians."""
    fx, fy = np.meshgrid(np.fft.fftfreq(SIDE), np.fft.fftfreq(SIDE))
    radius, angle = np.hypot(fx, fy), np.arctan2(fy, fx)
    filters = []
    for scale, count in enumerate(ORIENTATIONS):
        centre = 0.3 / 1.85**scale
        for k in range(count):
            turn = np.angle(np.exp(1j * (angle - np.pi * k / count)))
            radial = -10 * 0.35 * (radius / centre - 1) ** 2
            filters.append(np.exp(radial - 2 * (16 * count**2 / 32**2) * np.pi * turn**2))
    return np.array(filters, dtype=np.float32)
