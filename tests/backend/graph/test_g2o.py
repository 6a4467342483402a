"""g2o files, read and written, with GTSAM's own reader and writer as the yardstick."""

from pathlib import Path

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.backend.analysis.judge import split_edges
from semslam.backend.graph.chain import OdometryChain
from semslam.backend.graph.checks import checked_covariance, checked_pose
from semslam.backend.graph.g2o import read_g2o, write_g2o
from semslam.backend.graph.keys import chain_of, key_name
from semslam.backend.graph.products import Edge, PosedGraph
from semslam.backend.pose_graph import PoseGraph
from semslam.errors import GraphError
from semslam.geometry.se3 import exp_so3, make_transform

VERTEX = "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n"
IDENTITY_INFORMATION = "1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1"


def random_pose(rng):
    return make_transform(exp_so3(rng.uniform(-1.8, 1.8, 3)), rng.uniform(-50, 50, 3))


def random_covariance(rng):
    A = rng.normal(size=(6, 6))
    return A @ A.T * 1e-3 + np.eye(6) * 1e-4


def random_graph(seed, count=6):
    rng = np.random.default_rng(seed)
    poses = {int(key): random_pose(rng) for key in rng.choice(1000, count, replace=False)}
    keys = sorted(poses)
    edges = tuple(
        Edge(a, b, random_pose(rng), random_covariance(rng)) for a, b in zip(keys, keys[1:] + keys[:1], strict=True)
    )
    return PosedGraph(poses, edges, (keys[0],))


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 12))
def test_what_is_written_is_read_back(tmp_path_factory, seed, count):
    path = tmp_path_factory.mktemp("g2o") / "graph.g2o"
    graph = random_graph(seed, count)
    write_g2o(path, graph)
    again = read_g2o(path)
    assert again.anchors == graph.anchors
    assert sorted(again.poses) == sorted(graph.poses)
    for key, pose in graph.poses.items():
        assert np.allclose(again.poses[key], pose, atol=1e-12)
    for ours, theirs in zip(graph.edges, again.edges, strict=True):
        assert (ours.from_key, ours.to_key) == (theirs.from_key, theirs.to_key)
        assert np.allclose(ours.T_from_to, theirs.T_from_to, atol=1e-12)
        assert np.allclose(ours.covariance, theirs.covariance, rtol=1e-8, atol=1e-12)


def as_gtsam(graph):
    factors, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for key, pose in graph.poses.items():
        values.insert(key, gtsam.Pose3(pose))
    for e in graph.edges:
        noise = gtsam.noiseModel.Gaussian.Covariance(e.covariance)
        factors.add(gtsam.BetweenFactorPose3(e.from_key, e.to_key, gtsam.Pose3(e.T_from_to), noise))
    return factors, values


@pytest.mark.parametrize("seed", range(3))
def test_gtsam_reads_our_file_as_we_mean_it(tmp_path, seed):
    """Pins the order of the tangent space: ours and GTSAM's is rotation first, the file's translation first."""
    graph = random_graph(seed)
    write_g2o(tmp_path / "ours.g2o", graph)
    factors, values = gtsam.readG2o(str(tmp_path / "ours.g2o"), True)
    expected, _ = as_gtsam(graph)
    assert factors.size() == len(graph.edges)
    for i, edge in enumerate(graph.edges):
        assert np.allclose(factors.at(i).noiseModel().covariance(), edge.covariance, rtol=1e-6, atol=1e-12)
    assert factors.error(values) == pytest.approx(expected.error(values), rel=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_we_read_gtsams_file_as_gtsam_means_it(tmp_path, seed):
    graph = random_graph(seed)
    factors, values = as_gtsam(graph)
    gtsam.writeG2o(factors, values, str(tmp_path / "theirs.g2o"))
    again = read_g2o(tmp_path / "theirs.g2o")
    for ours, theirs in zip(graph.edges, again.edges, strict=True):
        assert np.allclose(ours.covariance, theirs.covariance, atol=1e-5)  # GTSAM writes six digits
        assert np.allclose(ours.T_from_to, theirs.T_from_to, atol=1e-3)


def test_translation_comes_first_in_the_file(tmp_path):
    covariance = np.diag([1.0, 1, 1, 0.01, 0.01, 0.01])
    graph = PosedGraph({0: np.eye(4), 1: np.eye(4)}, (Edge(0, 1, np.eye(4), covariance),))
    write_g2o(tmp_path / "graph.g2o", graph)
    line = (tmp_path / "graph.g2o").read_text().splitlines()[-1].split()
    assert float(line[10]) == pytest.approx(100.0)
    assert float(line[-1]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "name", ["pose3example", "pose3example-grid.txt", "Klaus3.g2o", "pose3example-offdiagonal.txt"]
)
def test_gtsams_example_graphs_have_the_cost_gtsam_gives_them(name):
    path = gtsam.findExampleDataFile(name)
    factors, values = gtsam.readG2o(path, True)
    ours, start = as_gtsam(read_g2o(Path(path)))
    assert ours.error(start) == pytest.approx(factors.error(values), rel=1e-6, abs=1e-9)


def test_keys_as_large_as_gtsams_symbols_keep_every_digit(tmp_path):
    keys = [gtsam.symbol("x", 0), gtsam.symbol("x", 1)]
    graph = PosedGraph(dict.fromkeys(keys, np.eye(4)), (Edge(keys[0], keys[1], np.eye(4), np.eye(6)),))
    write_g2o(tmp_path / "graph.g2o", graph)
    again = read_g2o(tmp_path / "graph.g2o")
    assert sorted(again.poses) == keys
    assert (again.edges[0].from_key, again.edges[0].to_key) == tuple(keys)


def test_a_graph_of_edges_alone_is_chained(tmp_path):
    path = tmp_path / "edges.g2o"
    path.write_text(
        f"EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 {IDENTITY_INFORMATION}\n"
        f"EDGE_SE3:QUAT 1 2 1 0 0 0 0 0 1 {IDENTITY_INFORMATION}\n"
    )
    assert [pose[0, 3] for pose in read_g2o(path).poses.values()] == [0.0, 1.0, 2.0]


def test_toro_edges_are_translation_first(tmp_path):
    path = tmp_path / "toro.txt"
    path.write_text("EDGE3 0 1 1 2 3 0 0 0.5 100 0 0 0 0 0 100 0 0 0 0 100 0 0 0 4 0 0 4 0 4\n")
    (edge,) = read_g2o(path).edges
    assert np.allclose(edge.T_from_to, make_transform(exp_so3([0, 0, 0.5]), [1, 2, 3]))
    assert np.allclose(np.diag(edge.covariance), [0.25] * 3 + [0.01] * 3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no 3-D pose graph"),
        ("hello world\n", "no 3-D pose graph"),
        ("VERTEX_SE2 0 0 0 0\n", "2-D"),
        ("VERTEX_SE3:QUAT 0 0 0 0 0 0 0\n", "Line 1 .* 7 words"),
        ("VERTEX_SE3:QUAT 0 0 0 x 0 0 0 1\n", "not a number"),
        ("VERTEX_SE3:QUAT 0.5 0 0 0 0 0 0 1\n", "whole number"),
        ("VERTEX_SE3:QUAT 0 nan 0 0 0 0 0 1\n", "not finite"),
        ("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 0\n", "rotation that is zero"),
        (VERTEX + VERTEX, "second time"),
        (VERTEX + f"EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 0 {IDENTITY_INFORMATION}\n", "Line 2 .* rotation"),
        (VERTEX + "EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1" + " 0" * 21 + "\n", "cannot be inverted"),
        (VERTEX + "EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1 -1" + IDENTITY_INFORMATION[1:] + "\n", "positive definite"),
        (VERTEX + "EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1 nan" + IDENTITY_INFORMATION[1:] + "\n", "not finite"),
    ],
)
def test_a_malformed_file_is_one_sentence(tmp_path, text, words):
    path = tmp_path / "bad.g2o"
    path.write_text(text)
    with pytest.raises(GraphError, match=words) as caught:
        read_g2o(path)
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_opened(tmp_path):
    with pytest.raises(GraphError, match="cannot be read"):
        read_g2o(tmp_path / "missing.g2o")
    (tmp_path / "binary.g2o").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(GraphError, match="cannot be read"):
        read_g2o(tmp_path / "binary.g2o")
    with pytest.raises(GraphError, match="cannot be written"):
        write_g2o(tmp_path / "nowhere" / "graph.g2o", random_graph(0))


# What other tools write.


def vertices(keys):
    return "".join(f"VERTEX_SE3:QUAT {key} {i} 0 0 0 0 0 1\n" for i, key in enumerate(keys))


def edge(from_key, to_key, tag="EDGE_SE3:QUAT", extra=""):
    return f"{tag} {from_key} {to_key}{extra} 1 0 0 0 0 0 1 {IDENTITY_INFORMATION}\n"


def test_switchable_edges_are_loops_and_their_switches_are_named(tmp_path):
    path = tmp_path / "vertigo.g2o"
    path.write_text(
        vertices(range(4))
        + "".join(edge(i, i + 1) for i in range(3))
        + "VERTEX_SWITCH 100 1\nEDGE_SWITCH_PRIOR 100 1 1.0\nVERTEX_SWITCH 101 1\n"
        + edge(0, 3, "EDGE_SE3_SWITCHABLE", " 100")
        + edge(1, 2, "EDGE_SE3_SWITCHABLE", " 101")
    )
    graph = read_g2o(path)
    odometry, loops = split_edges(graph)
    assert [(e.from_key, e.to_key) for e in odometry] == [(0, 1), (1, 2), (2, 3)]
    assert [(e.from_key, e.to_key, e.is_loop) for e in loops] == [(0, 3, True), (1, 2, True)]
    assert "2 switchable edges are read as loops" in graph.notes[0]
    assert "2 VERTEX_SWITCH, 1 EDGE_SWITCH_PRIOR" in graph.notes[1]


def test_every_line_that_is_not_read_is_named_and_counted(tmp_path):
    path = tmp_path / "prior.g2o"
    prior = f"EDGE_SE3_PRIOR 0 0 0 0 0 0 0 0 1 {IDENTITY_INFORMATION}\n"
    path.write_text(
        f"# comment\n\n{vertices(range(2))}{edge(0, 1)}{prior * 3}PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n\x1b[2J x\n"
    )
    (note,) = read_g2o(path).notes
    assert "3 EDGE_SE3_PRIOR, 1 PARAMS_SE3OFFSET, 1 \\x1b[2J" in note
    path.write_text(vertices(range(2)) + edge(0, 1))
    assert read_g2o(path).notes == ()


def test_an_edge_is_odometry_only_within_one_symbols_chain(tmp_path):
    a, b = ([gtsam.symbol(letter, i) for i in range(3)] for letter in "ab")
    path = tmp_path / "two.g2o"
    path.write_text(vertices(a + b) + edge(a[0], a[1]) + edge(a[1], a[2]) + edge(b[0], b[1]) + edge(a[2], b[0]))
    odometry, loops = split_edges(read_g2o(path))
    assert len(odometry) == 3
    assert [(key_name(e.from_key), key_name(e.to_key)) for e in loops] == [("a2", "b0")]


def test_chains_of_odometry_end_with_their_symbol():
    a, b = gtsam.symbol("a", 7), gtsam.symbol("b", 0)
    joined = OdometryChain([a, b], [Edge(a, b, np.eye(4), np.eye(6))]).relative([a], [b])[2]
    assert not joined[0]
    assert OdometryChain([5, 6], [Edge(5, 6, np.eye(4), np.eye(6))]).relative([5], [6])[2][0]


@pytest.mark.parametrize(
    ("key", "name"),
    [(0, "0"), (12, "12"), (gtsam.symbol("x", 12), "x12"), (gtsam.LabeledSymbol(120, 65, 3).key(), "xA3")],
)
def test_keys_have_names(key, name):
    assert key_name(key) == name
    assert chain_of(key) == (0 if name.isdecimal() else chain_of(key - 1))


def test_several_keys_may_be_fixed_in_one_line(tmp_path):
    path = tmp_path / "graph.g2o"
    path.write_text(vertices(range(3)) + edge(0, 1) + edge(1, 2) + "FIX 0 2\n")
    assert read_g2o(path).anchors == (0, 2)


@pytest.mark.parametrize("key", ["9" * 5000, str(2**63), "-1", "1.5", "x1"])
def test_keys_that_cannot_be_are_refused(tmp_path, key):
    path = tmp_path / "bad.g2o"
    path.write_text(f"VERTEX_SE3:QUAT {key} 0 0 0 0 0 0 1\n")
    with pytest.raises(GraphError, match="not a whole number below") as caught:
        read_g2o(path)
    assert len(str(caught.value)) < 200


WORDS = st.sampled_from(
    [
        *"0123456789-.e# \n",
        *("nan", "1e999", "\x1b", "é", "0 0 0 0 0 0 1", VERTEX, IDENTITY_INFORMATION),
        *("FIX ", "VERTEX_SE3:QUAT ", "EDGE_SE3:QUAT 0 0 ", "EDGE_SE3_SWITCHABLE "),
    ]
)


@settings(max_examples=300)
@given(words=st.lists(WORDS, max_size=30))
def test_no_graph_raises_anything_foreign(tmp_path_factory, words):
    path = tmp_path_factory.getbasetemp() / "fuzz.g2o"
    path.write_text("".join(words))
    try:
        read_g2o(path)
    except GraphError as error:
        assert str(error).isprintable()


def test_poses_of_gtsam_are_poses():
    T = random_pose(np.random.default_rng(0))
    assert np.allclose(checked_pose(gtsam.Pose3(T), "The pose"), T)
    graph = PoseGraph()
    graph.add_keyframe(0, gtsam.Pose3())
    graph.add_keyframe(1, gtsam.Pose3(T))
    graph.add_odometry(0, 1, gtsam.Pose3(T), np.eye(6))
    assert np.allclose(graph.optimize().poses[1], T)


@pytest.mark.parametrize("pose", [None, "pose", [[1, 2], [3]], object(), gtsam.Rot3(), {}, 1j, np.full((4, 4), 1e300)])
def test_what_is_no_pose_is_one_sentence(pose):
    with pytest.raises(GraphError, match="The pose"):
        checked_pose(pose, "The pose")
    with pytest.raises(GraphError, match="The pose"):
        checked_covariance(pose, "The pose")
