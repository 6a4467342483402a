"""Connected components of labelled voxels."""

from itertools import product

import numpy as np

from semslam.loop.detectors.objects.labelled import FIRST_THING
from semslam.types import IntArray

LATER = tuple(step for step in product((-1, 0, 1), repeat=3) if step > (0, 0, 0))
"""Half of a voxel's 26 neighbours; the other half has it as such a neighbour."""


def connected_components(cells: IntArray, winners: IntArray) -> IntArray:
    """The connected component (V,) of each voxel among those of its group that touch it; -1 for structure and void.

    Components are numbered group by group, and within one by their first voxel.

    Args:
        cells: (V, 3) coordinates, which lie within some ten metres.
        winners: (V,) groups.
    """
    from scipy.sparse import coo_array, csgraph

    owners = np.full(len(cells), -1, dtype=np.int64)
    rows = np.flatnonzero(winners >= FIRST_THING)
    if not len(rows):
        return owners
    groups, count = winners[rows], len(rows)
    own = cells[rows] - cells[rows].min(axis=0) + 1
    sides = own.max(axis=0) + 2
    strides = np.array([sides[1] * sides[2], sides[2], 1])
    numbers = own @ strides
    grid = np.full(int(sides.prod()), -1, dtype=np.int32)
    grid[numbers] = np.arange(count)
    neighbours = grid[numbers[:, None] + np.array(LATER) @ strides]
    one, which = np.nonzero(neighbours >= 0)
    other = neighbours[one, which]
    touching = groups[one] == groups[other]
    edges = (np.ones(int(touching.sum()), dtype=bool), (one[touching], other[touching]))
    total, labels = csgraph.connected_components(coo_array(edges, shape=(count, count)), directed=False)
    first = np.full(total, len(grid))
    np.minimum.at(first, labels, numbers)
    order = np.lexsort((first, groups[grid[first]]))
    place = np.empty(total, dtype=np.int64)
    place[order] = np.arange(total)
    owners[rows] = place[labels]
    return owners
