"""Graphs from elsewhere: which of their edges are odometry, and which of their loops are accepted."""

from collections.abc import Mapping, Sequence

from semslam.backend.graph.keys import chain_of
from semslam.backend.graph.products import Edge, GraphSolution, PosedGraph
from semslam.backend.pose_graph import PoseGraph
from semslam.config import BackendConfig
from semslam.errors import GraphError
from semslam.types import LoopCandidate, LoopConstraint, Transform


def judge_graph(graph: PosedGraph, config: BackendConfig) -> GraphSolution:
    """Optimise a graph as it was read, with a verdict for each of its loops.

    Edges between keys that follow one another in one chain (``keys.chain_of``) are odometry; all others, and those
    that the file states to be, are loops.

    Raises:
        GraphError: the graph is malformed or cannot be optimised.
    """
    odometry, loops = split_edges(graph)
    constraints = [constraint_of(edge) for edge in loops]
    return rebuilt(graph.poses, odometry, constraints, graph.anchors, config).optimize()


def split_edges(graph: PosedGraph | GraphSolution) -> tuple[tuple[Edge, ...], tuple[Edge, ...]]:
    """Odometry and loops of a graph; a second edge between neighbours counts as a loop.

    Raises:
        GraphError: an edge joins a keyframe that is not in the graph.
    """
    order = {key: place for place, key in enumerate(sorted(graph.poses))}
    odometry: dict[tuple[int, int], Edge] = {}
    loops: list[Edge] = []
    for edge in graph.edges:
        pair = (min(edge.from_key, edge.to_key), max(edge.from_key, edge.to_key))
        if pair[0] not in order or pair[1] not in order:
            raise GraphError(f"An edge joins the keyframes {pair[0]} and {pair[1]}, of which one is not in the graph.")
        follows = order[pair[1]] - order[pair[0]] == 1 and chain_of(pair[0]) == chain_of(pair[1])
        if follows and not edge.is_loop and pair not in odometry:
            odometry[pair] = edge
        else:
            loops.append(edge)
    return tuple(odometry.values()), tuple(loops)


def constraint_of(edge: Edge, detector: str = "file") -> LoopConstraint:
    """An edge as a loop of which nothing but the measurement is known; ``to_key`` is the query."""
    candidate = LoopCandidate(query=edge.to_key, match=edge.from_key, score=1.0, detector=detector)
    return LoopConstraint(
        candidate=candidate,
        T_match_query=edge.T_from_to,
        covariance=edge.covariance,
        fitness=0.0,
        inlier_rmse=0.0,
        overlap=0.0,
        inliers=0,
        method="file",
    )


def rebuilt(
    poses: Mapping[int, Transform],
    odometry: Sequence[Edge],
    loops: Sequence[LoopConstraint],
    anchors: Sequence[int],
    config: BackendConfig,
) -> PoseGraph:
    """A pose graph of these parts; each anchor is held where it stands.

    Raises:
        GraphError: a part is malformed, or two loops join the same pair in the same direction.
    """
    graph = PoseGraph(config)
    for key, T_world_cam in sorted(poses.items()):
        graph.add_keyframe(key, T_world_cam)
    for key in anchors:
        graph.add_prior(key, poses[key])
    for edge in odometry:
        graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
    for loop in loops:
        graph.add_loop(loop)
    return graph
