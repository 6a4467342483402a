"""Connected components of the graph, and their placement by the loops between them."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from semslam.backend.graph.products import Edge
from semslam.geometry.se3 import invert, rotation_angle
from semslam.types import FloatArray, Transform

SAME_PLACE_M = 0.5
SAME_PLACE_RAD = 0.35


def connected_components(keys: Iterable[int], edges: Iterable[Edge]) -> list[tuple[int, ...]]:
    """Sets of keys joined by edges, each ascending; the largest first, ties by the lowest key."""
    return connected(keys, ((edge.from_key, edge.to_key) for edge in edges))


def connected(keys: Iterable[int], pairs: Iterable[tuple[int, int]]) -> list[tuple[int, ...]]:
    """Sets of keys joined by pairs, in the order of ``connected_components``."""
    parent = {key: key for key in keys}

    def root(key: int) -> int:
        while parent[key] != key:
            parent[key] = parent[parent[key]]
            key = parent[key]
        return key

    for a, b in pairs:
        low, high = sorted((root(a), root(b)))
        parent[high] = low
    groups: dict[int, list[int]] = {}
    for key in sorted(parent):
        groups.setdefault(root(key), []).append(key)
    return sorted((tuple(group) for group in groups.values()), key=lambda group: (-len(group), group[0]))


def place_components(
    poses: Mapping[int, Transform], components: Sequence[tuple[int, ...]], loops: Sequence[Edge]
) -> dict[int, Transform]:
    """Move each component rigidly to where most loops to an already placed one want it.

    Each loop between the two is a hypothesis of the move; the one nearest to all the others wins, far ones
    counting no more than a little off ones. A component that no loop reaches stays where it is.

    Args:
        poses: T_world_cam by key.
        components: keys joined by odometry; the first stays in place.
        loops: edges, of which those between components matter.
    """
    placed = dict(poses)
    home = {key: index for index, component in enumerate(components) for key in component}
    done = {0}
    while True:
        moves: dict[int, list[Transform]] = {}
        for loop in loops:
            a, b = home[loop.from_key], home[loop.to_key]
            if (a in done) == (b in done):
                continue
            target = placed[loop.from_key] @ loop.T_from_to @ invert(placed[loop.to_key])
            index, move = (b, target) if a in done else (a, invert(target))
            moves.setdefault(index, []).append(move)
        if not moves:
            return placed
        index = max(moves, key=lambda i: (len(moves[i]), -i))
        move = _consensus(np.stack(moves[index]), placed[components[index][0]])
        placed.update({key: move @ placed[key] for key in components[index]})
        done.add(index)


def _consensus(moves: FloatArray, anchor: FloatArray) -> FloatArray:
    # Compared at a pose of the component, for far from the world's origin a small turn is a long way.
    moved = moves @ anchor
    between = invert(moved)[:, None] @ moved[None]
    distance = np.linalg.norm(between[..., :3, 3], axis=-1) / SAME_PLACE_M + rotation_angle(between) / SAME_PLACE_RAD
    return np.asarray(moves[np.argmin(np.minimum(distance, 1.0).sum(1))])
