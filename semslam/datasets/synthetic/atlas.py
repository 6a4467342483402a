"""All textures in one image, each with its mip levels, so that one remap looks every pixel's colour up."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from semslam.datasets.synthetic.textures import SIZE, Image
from semslam.geometry.se3 import Float32Array

LEVELS = 8
BORDER = 2
ROW = 320
"""cv2.remap takes images under 32767 a side: lists of pixels are laid out in rows of this many."""
GAMMA = 2.2


@dataclass(frozen=True, slots=True)
class Material:
    """What a surface is made of.

    Attributes:
        image: (SIZE, SIZE, 3) uint8 sRGB albedo.
        tile: metres (or texture units) that the image spans along u and v.
        glow: light it gives by itself when its lamp is on, in the unit of irradiance; 0 for most.
        lamp: which kind of light the glow belongs to, "day" or "lamps".
    """

    image: Image
    tile: float = 1.0
    glow: float = 0.0
    lamp: str = "lamps"


class TextureAtlas:
    """Mip-mapped textures of a few materials in one image.

    Args:
        materials: in the order of their indices.

    Attributes:
        size: side of all textures in texels.
        tiles: (M,) metres that each texture spans.
        mean_albedo: (M, 3) mean linear reflectance.
    """

    def __init__(self, materials: Mapping[str, Material]) -> None:
        self.size = SIZE
        self.tiles = np.array([material.tile for material in materials.values()])[:, None]
        # A mip pyramid takes one cell for level 0 and half a cell's width beside it for all the others.
        cell = SIZE + 2 * LEVELS * BORDER
        columns = int(np.ceil(np.sqrt(len(materials))))
        rows = -(-len(materials) // columns)
        self._image = np.zeros((rows * cell, columns * (cell * 3 // 2), 3), dtype=np.uint8)
        self._places = np.zeros((len(materials), LEVELS, 3), dtype=np.float32)
        albedo = []
        for k, material in enumerate(materials.values()):
            self._pack(k, material.image, (k % columns) * (cell * 3 // 2), (k // columns) * cell, cell)
            albedo.append((cv2.resize(material.image, (32, 32), interpolation=cv2.INTER_AREA) / 255.0) ** GAMMA)
        self.mean_albedo = np.stack(albedo).mean((1, 2))

    def _pack(self, k: int, image: Image, left: int, top: int, cell: int) -> None:
        x, y = left, top
        for level in range(LEVELS):
            wrapped = cv2.copyMakeBorder(image, BORDER, BORDER, BORDER, BORDER, cv2.BORDER_WRAP)
            size = len(wrapped)
            self._image[y : y + size, x : x + size] = wrapped
            self._places[k, level] = x + BORDER - 0.5, y + BORDER - 0.5, len(image)
            x, y = (left + cell, top) if level == 0 else (x, y + size)
            image = np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), dtype=np.uint8)

    def lookup(self, materials: npt.NDArray[np.int64], uv: Float32Array, lod: Float32Array) -> Float32Array:
        """Trilinear sRGB albedo (N, 3) float32 in 0..255.

        Args:
            materials: (N,) material indices.
            uv: (N, 2) texture coordinates in tiles.
            lod: (N,) log2 of the texels a pixel covers at level 0.
        """
        lod = np.clip(lod, 0.0, LEVELS - 1.001)
        level = lod.astype(np.int64)
        inside = uv - np.floor(uv)
        index = materials * LEVELS + level
        near, far = self._bilinear(index, inside), self._bilinear(index + 1, inside)
        far -= near
        far *= (lod - level).astype(np.float32)[:, None]
        near += far
        return near

    def _bilinear(self, index: npt.NDArray[np.int64], inside: Float32Array) -> Float32Array:
        place = self._places.reshape(-1, 3).take(index, axis=0)
        flat = np.zeros((-(-len(inside) // ROW) * ROW, 2), dtype=np.float32)
        np.multiply(inside, place[:, 2:], out=flat[: len(inside)])
        flat[: len(inside)] += place[:, :2]
        x, y = flat[:, 0].reshape(-1, ROW), flat[:, 1].reshape(-1, ROW)
        colors = np.empty((len(x), ROW, 3), dtype=np.float32)
        for start in range(0, len(x), 32000):
            rows = slice(start, start + 32000)
            colors[rows] = cv2.remap(self._image, x[rows], y[rows], cv2.INTER_LINEAR)
        return colors.reshape(-1, 3)[: len(inside)]
