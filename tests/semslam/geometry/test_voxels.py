"""Voxels and the table of those that were seen."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from semslam.geometry.voxels import VoxelTable, cell_keys, voxel_cells, voxel_keys

POINTS = arrays.arrays(np.float64, (20, 3), elements=st.floats(-1000, 1000))


@given(POINTS, st.floats(0.01, 1.0))
def test_a_number_names_its_voxel(points: np.ndarray, size: float) -> None:
    cells = voxel_cells(voxel_keys(points, size))
    assert np.array_equal(cells, np.floor(points / size))
    assert np.array_equal(cell_keys(cells), voxel_keys(points, size))


@given(POINTS)
def test_a_table_keeps_the_rows_that_it_gave(points: np.ndarray) -> None:
    table = VoxelTable(0.5)
    first = table.rows(points[:12])
    table.rows(points)
    assert np.array_equal(table.rows(points[:12]), first)
    assert np.array_equal(table.find(voxel_keys(points[:12], 0.5)), first)
    assert sorted(set(table.rows(points).tolist())) == list(range(len(table)))
    assert np.array_equal(table.keys[first], voxel_keys(points[:12], 0.5))


def test_a_voxel_never_seen_has_no_row() -> None:
    table = VoxelTable(1.0)
    table.rows(np.zeros((1, 3)))
    assert table.find(voxel_keys(np.array([[0.5, 0.5, 0.5], [1.5, 0.0, 0.0]]), 1.0)).tolist() == [0, -1]
