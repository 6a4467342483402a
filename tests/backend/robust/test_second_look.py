"""Loops that odometry leaves in doubt, decided by the loops of other places."""

import gtsam
import numpy as np
import pytest

from semslam.backend.analysis.judge import constraint_of, rebuilt
from semslam.backend.analysis.simulation import SIGMAS, measure, measure_odometry, ring
from semslam.backend.graph.chain import OdometryChain
from semslam.backend.graph.factors import between_factor, make_values, prior_factor
from semslam.backend.graph.products import Edge
from semslam.backend.robust.drift import Drift
from semslam.backend.robust.outvoting import outvote
from semslam.backend.robust.plausibility import reconsider, screen_loops
from semslam.backend.robust.strategy import RobustProblem
from semslam.backend.steps import finish
from semslam.config import BackendConfig
from semslam.geometry.se3 import compose, make_transform

TOUR = ring(15, laps=1, radius=0.8)
APART = np.array([4.3, 0.0, 0.0])
HALL, ROOM, TWIN = range(10), range(22, 37), range(47, 62)
HALL_AGAIN, ROOM_AGAIN = range(82, 92), range(104, 119)
SLIP = 70


def walk(start, end, count):
    """Keyframes (count, 4, 4) that look one way on a straight line."""
    poses = np.tile(TOUR[0], (count, 1, 1))
    poses[:, :3, 3] += np.linspace(start, end, count)
    return poses


def flat():
    """Through a hall into a room, on to its twin, a long way round, and again through the hall into the room."""
    hall, passage, there = walk([0, 0, -6], [0, 0, -3.2], 10), walk([0, 0, -3], [0, 0, -0.2], 12), TOUR.copy()
    there[:, :3, 3] += APART
    round_about = walk(APART, [0, 0, -6.2], 20)
    return np.concatenate([hall, passage, TOUR, walk([0.3, 0, 0], APART, 10), there, round_about, hall, passage, TOUR])


TRUTH = flat()


def odometry_of(rng, drift, sigma=0.12):
    """Odometry known to ``sigma`` metres a step, which slips by ``drift`` on the long way round."""
    covariance = np.diag(np.r_[SIGMAS[:3], [sigma] * 3] ** 2)
    slip = make_transform(np.eye(3), TRUTH[SLIP][:3, :3].T @ np.array([drift, 0, 0]))
    return [
        Edge(e.from_key, e.to_key, slip @ e.T_from_to if e.from_key == SLIP else e.T_from_to, covariance)
        for e in measure_odometry(TRUTH, rng)
    ]


def driven(edges):
    """Poses (4, 4) by key as odometry has them."""
    return dict(enumerate(compose([edge.T_from_to for edge in edges], TRUTH[0])))


def optimise(edges, loops):
    graph = rebuilt(driven(edges), edges, [constraint_of(loop) for loop in loops], (), BackendConfig())
    return [verdict.reason for verdict in graph.optimize().verdicts]


def rooms(rng):
    """True loops between the visits of the hall and of the room, and false ones from the twin to the room."""
    hall = measure(TRUTH, list(zip(HALL, HALL_AGAIN, strict=True)), rng)
    true = measure(TRUTH, list(zip(ROOM, ROOM_AGAIN, strict=True)), rng)
    alike = TRUTH.copy()
    alike[TWIN.start : TWIN.stop, :3, 3] -= APART
    return hall, true, measure(alike, list(zip(TWIN, ROOM_AGAIN, strict=True)), rng)


@pytest.mark.parametrize("seed", range(3))
def test_the_hall_tells_which_of_two_rooms_it_was(seed):
    rng = np.random.default_rng(seed)
    hall, true, false = rooms(rng)
    edges = odometry_of(rng, 2.15)
    assert set(optimise(edges, [*true, *false])) == {"ambiguous"}, "without the hall nothing decides"
    found = optimise(edges, [*hall, *true, *false])
    assert found[:10] == [None] * 10
    assert found[10:25] == [None] * 15
    assert set(found[25:]) == {"ambiguous"}


@pytest.mark.parametrize("seed", range(3))
def test_doubtful_loops_that_the_hall_contradicts_stay_withheld(seed):
    rng = np.random.default_rng(seed)
    hall, _, false = rooms(rng)
    found = optimise(odometry_of(rng, -1.5), [*hall, *false])
    assert found[:10] == [None] * 10
    assert set(found[10:]) == {"ambiguous"}


def graph_of(edges, loops=()):
    graph = gtsam.NonlinearFactorGraph()
    graph.add(prior_factor(0, TRUTH[0], 1e-4))
    for edge in (*edges, *loops):
        graph.add(between_factor(edge))
    return graph, gtsam.LevenbergMarquardtOptimizer(graph, make_values(driven(edges))).optimize()


def test_a_graph_of_odometry_alone_says_what_odometry_says():
    rng = np.random.default_rng(0)
    hall, true, false = rooms(rng)
    edges = odometry_of(rng, -1.0)
    loops = [*hall, *true, *false, Edge(110, 30, np.eye(4), 0.01 * np.eye(6))]
    by_graph = Drift.from_graph(*graph_of(edges), loops)
    by_chain = Drift.from_odometry(OdometryChain(range(len(TRUTH)), edges), loops)
    assert np.allclose(by_graph.distances, by_chain.distances, rtol=1e-4)
    assert np.allclose(by_graph.shifts, by_chain.shifts, atol=1e-4)
    assert np.allclose(by_graph.headings, by_chain.headings, rtol=1e-4)


def test_loops_elsewhere_make_a_graph_surer_than_odometry():
    rng = np.random.default_rng(0)
    hall, true, false = rooms(rng)
    edges = odometry_of(rng, 2.15)
    alone = Drift.from_odometry(OdometryChain(range(len(TRUTH)), edges), [*true, *false])
    known = Drift.from_graph(*graph_of(edges, hall), [*true, *false])
    assert (known.headings < alone.headings).all()
    assert np.median(known.distances[:15]) < 0.8 * np.median(alone.distances[:15])
    assert np.median(known.distances[15:]) > 1.3 * np.median(alone.distances[15:])


def test_ends_that_odometry_does_not_join_lie_nowhere():
    edges = [edge for edge in odometry_of(np.random.default_rng(0), 0.0) if edge.from_key != 30]
    drift = Drift.from_odometry(OdometryChain(range(len(TRUTH)), edges), [Edge(3, 110, np.eye(4), np.eye(6))])
    assert drift.distances.tolist() == [0.0]


def test_a_graph_that_leaves_something_open_decides_nothing():
    rng = np.random.default_rng(0)
    _, true, false = rooms(rng)
    edges, loops = odometry_of(rng, 2.15), [*true, *false]
    chain = OdometryChain(range(len(TRUTH)), edges)
    screened = screen_loops(chain, loops, 4.7, 1.5)
    assert set(screened.reasons) == {"ambiguous"}
    graph, values = graph_of(edges)
    graph.remove(0)  # the prior: nothing holds the graph
    assert reconsider(chain, graph, values, loops, screened, 4.7) is screened


def outvoted(edges, loops, held=True):
    """Reasons after larger groups have been heard."""
    chain = OdometryChain(range(len(TRUTH)), edges)
    graph, values = graph_of(edges)
    if not held:
        graph.remove(0)  # the prior
    screening = screen_loops(chain, loops, 4.7, 1.5)
    assert screening.eligible.all(), "odometry alone excludes none"
    return finish(outvote(chain, RobustProblem(graph, edges, loops, values, 4.0, 20), screening)).reasons


@pytest.mark.parametrize("seed", [0, 1, 2, 4])
def test_a_few_loops_into_a_twin_that_nothing_else_contradicts_are_outvoted_by_the_hall(seed):
    hall, true, false = rooms(np.random.default_rng(seed))
    edges = odometry_of(np.random.default_rng(seed + 10), 2.15)
    assert outvoted(edges, [*hall, *false[:3]]) == (*(None,) * 10, *("ambiguous",) * 3)
    assert outvoted(edges, [*hall, *true[:3]]) == (None,) * 13
    assert optimise(edges, [*hall, *true[:3]]) == [None] * 13
    assert outvoted(edges, [*hall, *false[:4]]) == (None,) * 14, "ten are not three times as many as four"
    assert outvoted(edges, [*hall, *false[:3]], held=False) == (None,) * 13


def test_the_graph_as_a_whole_asks_the_larger_groups():
    hall, _, false = rooms(np.random.default_rng(2))
    edges = odometry_of(np.random.default_rng(12), 2.15)
    assert optimise(edges, false[:3]) == [None] * 3
    assert optimise(edges, [*hall, *false[:3]]) == [None] * 10 + ["ambiguous"] * 3
