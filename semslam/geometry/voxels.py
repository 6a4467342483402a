"""Space cut into cubes: which one a point lies in, and a row of a table for each of them."""

import numpy as np
import numpy.typing as npt

VOXEL_MASK = (1 << 21) - 1
"""Bits of a voxel's index along one axis: one whole number then names the voxel."""
SIGN = 1 << 20

IntArray = npt.NDArray[np.int64]


def voxel_keys(points: npt.NDArray[np.floating], size: float) -> IntArray:
    """The number (N,) of the cube that each point (N, 3) lies in; cubes of ``size`` metres, a million to each side."""
    return cell_keys(np.floor(points / size).astype(np.int64))


def voxel_cells(keys: IntArray) -> IntArray:
    """Signed whole-number coordinates (N, 3) of the cubes with these numbers (N,)."""
    cells = np.stack([keys >> 42, keys >> 21, keys], axis=1) & VOXEL_MASK
    return np.where(cells >= SIGN, cells - (SIGN << 1), cells)


def cell_keys(cells: IntArray) -> IntArray:
    """The numbers (N,) of cubes given by their signed coordinates (N, 3)."""
    wrapped = cells & VOXEL_MASK
    return np.asarray((wrapped[:, 0] << 42) | (wrapped[:, 1] << 21) | wrapped[:, 2], dtype=np.int64)


class VoxelTable:
    """Gives each voxel that is seen a row of its own, 0, 1, 2... in the order in which they are first seen.

    Args:
        size: the voxel's side in metres.
    """

    def __init__(self, size: float) -> None:
        self.size = size
        self._rows: dict[int, int] = {}

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def keys(self) -> IntArray:
        """The voxels' numbers (V,), by row."""
        return np.fromiter(self._rows, dtype=np.int64, count=len(self._rows))

    def rows(self, points: npt.NDArray[np.floating]) -> IntArray:
        """The row (N,) of each point's (N, 3) voxel; new voxels get new rows."""
        unique, inverse = np.unique(voxel_keys(points, self.size), return_inverse=True)
        rows = [self._rows.setdefault(key, len(self._rows)) for key in unique.tolist()]
        return np.array(rows, dtype=np.int64)[inverse]

    def find(self, keys: IntArray) -> IntArray:
        """The row (N,) of each numbered voxel (N,), -1 for one that was never seen."""
        return np.array([self._rows.get(key, -1) for key in keys.tolist()], dtype=np.int64)
