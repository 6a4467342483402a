"""Pose graphs as g2o text: VERTEX_SE3:QUAT, EDGE_SE3:QUAT, FIX; TORO's VERTEX3 and EDGE3 are read too.

Loops written as switchable edges (EDGE_SE3_SWITCHABLE of Suenderhauf's Vertigo) are read as loops, whose switches
the robust strategy takes the place of. Every other tag is named and counted in the graph's notes.

A file's information matrix is the upper triangle in the order x, y, z, then rotation: translation first, while
everything here is rotation first. As in GTSAM the rotation part is per radian.
"""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from semslam.backend.graph.checks import checked_covariance, checked_pose
from semslam.backend.graph.keys import LARGEST, key_name
from semslam.backend.graph.products import Edge, GraphSolution, PosedGraph
from semslam.errors import GraphError, SemslamError, printable, shortened
from semslam.files import read_text
from semslam.geometry.se3 import compose, make_transform, quaternions_to_rotations, rotations_to_quaternions
from semslam.types import FloatArray, Transform

TRIANGLE = np.triu_indices(6)
SWAPPED = [3, 4, 5, 0, 1, 2]
"""Translation-first rows as rotation-first ones, and back."""
SWITCHABLE = "EDGE_SE3_SWITCHABLE"
FIELDS = {"VERTEX_SE3:QUAT": 8, "VERTEX3": 7, "EDGE_SE3:QUAT": 30, "EDGE3": 29, SWITCHABLE: 31, "FIX": 1}
"""Words after the tag; FIX may have more."""
MAX_TAGS = 10
"""How many kinds of lines that were not read are named."""
MAX_KEY_DIGITS = 19
SKIPPED = ("VERTEX2", "EDGE2", "VERTEX_SE2", "EDGE_SE2")


def write_g2o(path: Path, graph: PosedGraph | GraphSolution) -> None:
    """Write a graph, whole or not at all; numbers keep every digit.

    Of a solution the optimised poses are written, with odometry and the accepted loops.

    Raises:
        GraphError: the file cannot be written.
    """
    lines = [f"VERTEX_SE3:QUAT {key} {_pose_text(T)}" for key, T in sorted(graph.poses.items())]
    lines += [f"FIX {key}" for key in graph.anchors]
    for edge in graph.edges:
        information = np.linalg.inv(edge.covariance)[np.ix_(SWAPPED, SWAPPED)]
        numbers = " ".join(repr(float(value)) for value in information[TRIANGLE])
        lines.append(f"EDGE_SE3:QUAT {edge.from_key} {edge.to_key} {_pose_text(edge.T_from_to)} {numbers}")
    try:
        partial = path.with_name(f".{path.name}.partial")
        partial.write_text("\n".join(lines) + "\n", encoding="ascii")
        partial.replace(path)
    except OSError as error:
        raise GraphError(f"The graph cannot be written to {path}: {error}.") from error


def read_g2o(path: Path) -> PosedGraph:
    """Read a graph; keyframes without a value of their own are chained from the edges.

    Raises:
        GraphError: the file cannot be read, is no 3-D pose graph, or a line is malformed; the message names it.
    """
    poses: dict[int, Transform] = {}
    edges: list[Edge] = []
    anchors: list[int] = []
    passed_over: Counter[str] = Counter()
    for number, tag, words in _lines(path):
        where = f"Line {number} of {path.name}"
        if tag not in FIELDS:
            passed_over[tag] += 1
        elif tag == "FIX":
            anchors += [_key(word, where) for word in words]
        elif len(words) != FIELDS[tag]:
            raise GraphError(f"{where} has {len(words)} words after {tag}, not {FIELDS[tag]}.")
        elif tag.startswith("VERTEX"):
            key = _key(words[0], where)
            if key in poses:
                raise GraphError(f"{where} gives keyframe {key_name(key)} a second time.")
            poses[key] = _pose(_numbers(words[1:], where), where)
        else:
            edges.append(_edge(tag, words, where))
    if not poses and not edges:
        raise GraphError(f"{path} holds no 3-D pose graph.")
    _chain(poses, edges)
    notes = _notes(path.name, passed_over, sum(edge.is_loop for edge in edges))
    return PosedGraph(poses, tuple(edges), tuple(key for key in anchors if key in poses), notes)


def _lines(path: Path) -> Iterator[tuple[int, str, list[str]]]:
    """Number, tag and words of each line that is neither empty nor a comment."""
    for number, line in enumerate(read_text(path, "The graph", GraphError).splitlines(), 1):
        tag, *words = line.split() or [""]
        if tag in SKIPPED:
            raise GraphError(f"Line {number} of {path.name} is of a 2-D graph ({tag}); only 3-D ones are read.")
        if tag and not tag.startswith("#"):
            yield number, tag, words


def _notes(name: str, passed_over: Counter[str], switchable: int) -> tuple[str, ...]:
    notes = []
    if switchable:
        notes.append(f"{name}: {switchable} switchable edges are read as loops.")
    if passed_over:
        tags = [f"{count} {shortened(tag, 40)}" for tag, count in passed_over.most_common(MAX_TAGS)]
        if len(passed_over) > MAX_TAGS:
            tags.append(f"{len(passed_over) - MAX_TAGS} more kinds")
        notes.append(f"{name}: these lines are not read and have no part in the result: {', '.join(tags)}.")
    return tuple(printable(note) for note in notes)


def _key(word: str, where: str) -> int:
    if not (word.isdecimal() and len(word) <= MAX_KEY_DIGITS) or int(word) > LARGEST:
        raise GraphError(f"{where} has the key {shortened(word)}, not a whole number below 2^63.")
    return int(word)


def _numbers(words: list[str], where: str) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError:
        raise GraphError(f"{where} holds a word that is not a number.") from None


def _pose(numbers: list[float], where: str) -> FloatArray:
    try:
        R = quaternions_to_rotations(numbers[3:])[0] if len(numbers) == 7 else _rotation_of_euler(*numbers[3:])
    except SemslamError:
        raise GraphError(f"{where} has a rotation that is zero or not finite.") from None
    return checked_pose(make_transform(R, numbers[:3]), where)


def _rotation_of_euler(roll: float, pitch: float, yaw: float) -> FloatArray:
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _edge(tag: str, words: list[str], where: str) -> Edge:
    from_key, to_key = (_key(word, where) for word in words[:2])
    numbers = _numbers(words[3 if tag == SWITCHABLE else 2 :], where)
    information = np.zeros((6, 6))
    information[TRIANGLE] = numbers[-21:]
    information += np.triu(information, 1).T
    try:
        covariance = np.linalg.inv(information)[np.ix_(SWAPPED, SWAPPED)]
    except np.linalg.LinAlgError:
        raise GraphError(f"{where} has an information matrix that cannot be inverted.") from None
    T_from_to = _pose(numbers[:-21], where)
    return Edge(from_key, to_key, T_from_to, checked_covariance(covariance, where), is_loop=tag == SWITCHABLE)


def _chain(poses: dict[int, Transform], edges: list[Edge]) -> None:
    for edge in edges:
        if edge.to_key not in poses:
            start = poses.setdefault(edge.from_key, np.eye(4))
            poses[edge.to_key] = compose([edge.T_from_to], start)[1]
        poses.setdefault(edge.from_key, np.eye(4))


def _pose_text(T: Transform) -> str:
    numbers = [*T[:3, 3], *rotations_to_quaternions(T[:3, :3])[0]]
    return " ".join(repr(float(value)) for value in numbers)
