"""Vertical planes of a submap: walls, doors, cupboard fronts."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.types import Float32Array, FloatArray, IntArray

ComplexArray = npt.NDArray[np.complex128]
BINS = 72
"""Directions of vertical surfaces, 5 degrees each."""
UPRIGHT = 0.35
"""Largest vertical component of a vertical surface's normal."""
NEAR_AZIMUTH = np.radians(15.0)
"""How far normals of one wall lie from its direction."""
DIRECTIONS = 8
"""Maximum number of directions that walls have."""


@dataclass(frozen=True, slots=True, eq=False)
class Walls:
    """Vertical planes, the largest first; n = (cos, sin) of the azimuth points to where they were seen from.

    Attributes:
        azimuths: (W,) float32 radians of n.
        offsets: (W,) float32 metres, n . p of its points.
        starts: (W,) float32 metres along (-sin, cos) where it begins.
        ends: (W,) float32 metres where it ends.
        areas: (W,) float32 square metres that were seen.
    """

    azimuths: Float32Array
    offsets: Float32Array
    starts: Float32Array
    ends: Float32Array
    areas: Float32Array

    def __len__(self) -> int:
        return len(self.areas)


def azimuths(facing: FloatArray, groups: IntArray, count: int) -> npt.NDArray[np.int8]:
    """How much vertical surface (count, BINS) of each group faces each direction; 127 at most."""
    upright = np.abs(facing[:, 2]) < UPRIGHT
    angle = np.arctan2(facing[upright, 1], facing[upright, 0])
    bins = np.floor(angle / (2 * np.pi) * BINS).astype(np.int64) % BINS
    table = np.bincount(groups[upright] * BINS + bins, minlength=count * BINS).reshape(count, BINS).astype(np.float64)
    table = np.sqrt(_smooth(table))
    return np.rint(127 * table / max(float(table.max()), 1e-9)).astype(np.int8)


def find_walls(centres: FloatArray, facing: FloatArray, config: ObjectsConfig) -> Walls:
    """Peaks of the normals' azimuths, and in each the peaks of the planes' offsets.

    Args:
        centres: (V, 3) metres, one point for each voxel, in the level frame.
        facing: (V, 3) unit normals.
        config: sizes and limits.
    """
    upright = np.flatnonzero(np.abs(facing[:, 2]) < UPRIGHT)
    points, normals = centres[upright], facing[upright, 0] + 1j * facing[upright, 1]
    normals /= np.maximum(np.abs(normals), 1e-9)
    found: list[tuple[float, float, float, float, float]] = []
    for direction in _directions(normals):
        found += _planes(points[_near(normals, direction)], direction, config)
    found.sort(key=lambda wall: (-wall[4], wall[0], wall[1]))
    columns = np.array(found[: config.max_walls], dtype=np.float32).reshape(-1, 5).T
    return Walls(*columns)


def _directions(normals: ComplexArray) -> list[float]:
    """Radians of the peaks of a histogram of azimuths, the highest first."""
    bins = np.floor(np.angle(normals) / (2 * np.pi) * BINS).astype(np.int64) % BINS
    counts = _smooth(np.bincount(bins, minlength=BINS)[None].astype(np.float64))[0]
    peaks = (counts >= np.roll(counts, 1)) & (counts > np.roll(counts, -1)) & (counts > 0)
    order = np.flatnonzero(peaks)
    order = order[np.argsort(-counts[order], kind="stable")][:DIRECTIONS]
    centres = (order + 0.5) / BINS * 2 * np.pi
    return [float(np.angle(normals[_near(normals, centre)].sum())) for centre in centres.tolist()]


def _near(normals: ComplexArray, direction: float) -> npt.NDArray[np.bool_]:
    """Which unit normals (N,), x + iy, lie near a direction."""
    return np.asarray(normals.real * np.cos(direction) + normals.imag * np.sin(direction) > np.cos(NEAR_AZIMUTH))


def _planes(
    points: FloatArray, direction: float, config: ObjectsConfig
) -> list[tuple[float, float, float, float, float]]:
    """Azimuth, offset, start, end and area of the planes of one direction."""
    if not len(points):
        return []
    normal, tangent = (
        np.array([np.cos(direction), np.sin(direction)]),
        np.array([-np.sin(direction), np.cos(direction)]),
    )
    offsets, along = points[:, :2] @ normal, points[:, :2] @ tangent
    low = offsets.min()
    bins = np.floor((offsets - low) / config.voxel).astype(np.int64)
    counts = np.bincount(bins, minlength=bins.max() + 3).astype(np.float64)
    planes: list[tuple[float, float, float, float, float]] = []
    least = config.min_wall / config.voxel**2
    while True:
        sums = counts + np.roll(counts, 1) + np.roll(counts, -1)
        peak = int(sums[:-1].argmax())
        if sums[peak] < least:
            return planes
        inside = np.abs(bins - peak) <= 1
        start, end = np.quantile(along[inside], (0.02, 0.98))
        planes.append(
            (
                direction,
                float(np.median(offsets[inside])),
                float(start),
                float(end),
                float(sums[peak]) * config.voxel**2,
            )
        )
        counts[max(peak - 1, 0) : peak + 2] = 0


def _smooth(rows: FloatArray) -> FloatArray:
    """Circular mean of each row (N, BINS) with its neighbours."""
    return np.asarray((np.roll(rows, 1, 1) + 2 * rows + np.roll(rows, -1, 1)) / 4)
