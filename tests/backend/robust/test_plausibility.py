"""Two rooms that look alike: loops between them agree with one another, and only odometry tells."""

import numpy as np
import pytest

from semslam.backend.analysis.judge import constraint_of, rebuilt
from semslam.backend.analysis.simulation import SIGMAS, measure, measure_odometry, ring
from semslam.backend.graph.chain import OdometryChain
from semslam.backend.pose_graph import Edge
from semslam.backend.robust.calibration import cycle_scale
from semslam.backend.robust.plausibility import screen_loops
from semslam.config import BackendConfig
from semslam.geometry.se3 import compose, make_transform
from semslam.plugins import ROBUST

TOUR = ring(15, laps=1, radius=0.8)
APART = np.array([4.3, 0.0, 0.0])
FIRST, TWIN, AGAIN = range(15), range(25, 40), range(50, 65)
LIMIT = 7.05


def twin_rooms():
    """The tour in one room, ten keyframes of corridor, the same tour in the other room, and back into the first."""
    there = TOUR.copy()
    there[:, :3, 3] += APART
    out, back = np.tile(TOUR[0], (10, 1, 1)), np.tile(TOUR[0], (10, 1, 1))
    out[:, :3, 3] += np.linspace(0.1, 0.9, 10)[:, None] * APART
    back[:, :3, 3] += np.linspace(0.9, 0.1, 10)[:, None] * APART
    return np.concatenate([TOUR, out, there, back, TOUR])


def loops_of(rng, sigmas=SIGMAS):
    """True loops into the first room, and false ones to and from its twin, as exact as the true ones."""
    true = measure(TRUTH, list(zip(FIRST, AGAIN, strict=True)), rng)
    alike = TRUTH.copy()
    alike[25:40, :3, 3] -= APART
    false = measure(alike, [*zip(FIRST, TWIN, strict=True), *zip(TWIN, AGAIN, strict=True)], rng)
    return true, false


TRUTH = twin_rooms()


def optimise(loops, rng, config=None, sigmas=SIGMAS, count=65):
    edges = measure_odometry(TRUTH[:count], rng, 1.0, sigmas)
    start = dict(enumerate(compose([edge.T_from_to for edge in edges], TRUTH[0])))
    return rebuilt(start, edges, [constraint_of(loop) for loop in loops], (), config or BackendConfig()).optimize()


def reasons(solution):
    return [verdict.reason for verdict in solution.verdicts]


@pytest.mark.parametrize("robust", [name for name in ROBUST if name != "none"])
def test_loops_between_twin_rooms_are_refused_though_they_are_the_more(robust):
    rng = np.random.default_rng(0)
    true, false = loops_of(rng)
    solution = optimise([*true, *false], rng, BackendConfig(robust=robust))
    assert reasons(solution)[15:] == ["inconsistent"] * 30
    if robust == "cauchy":  # which also gives up loops that odometry has drifted away from
        return
    assert reasons(solution)[:15] == [None] * 15
    assert min(verdict.drift for verdict in solution.verdicts[15:]) > LIMIT
    assert max(np.linalg.norm(solution.poses[k][:3, 3] - T[:3, 3]) for k, T in enumerate(TRUTH)) < 0.2


def test_loops_to_a_twin_room_are_refused_where_there_are_no_others():
    rng = np.random.default_rng(1)
    _, false = loops_of(rng)
    solution = optimise(false[:15], rng, count=40)
    assert reasons(solution) == ["inconsistent"] * 15
    assert solution.odometry_scale == 1.0


def test_without_the_test_the_graph_follows_the_twin():
    rng = np.random.default_rng(0)
    true, false = loops_of(rng)
    settings = BackendConfig(drift_slack=0.0)
    wide = SIGMAS * 20
    assert any(verdict.accepted for verdict in optimise([*true, *false], rng, settings, wide).verdicts[15:])


def drifting_chain(rng, drift=0.0, sigma=0.14):
    """Odometry known to ``sigma`` metres a step, which drifts by ``drift`` on the way back from the twin room."""
    covariance = np.diag(np.r_[[1e-5] * 3, [sigma**2] * 3])
    edges = measure_odometry(TRUTH, rng)
    shift = make_transform(np.eye(3), TRUTH[40][:3, :3].T @ np.array([drift, 0, 0]))
    return OdometryChain(
        range(len(TRUTH)),
        [
            Edge(e.from_key, e.to_key, shift @ e.T_from_to if e.from_key == 40 else e.T_from_to, covariance)
            for e in edges
        ],
    )


def test_where_odometry_cannot_tell_all_sides_are_withheld():
    rng = np.random.default_rng(2)
    true, false = loops_of(rng)
    assert set(screen_loops(drifting_chain(rng, 2.15), [*true, *false], 4.7, 1.5).reasons) == {"ambiguous"}


def test_true_loops_stand_where_odometry_has_drifted_by_two_fifths_of_the_way_to_the_twin():
    rng = np.random.default_rng(2)
    true, false = loops_of(rng)
    found = screen_loops(drifting_chain(rng, 1.8), [*true, *false], 4.7, 1.5)
    assert found.reasons == (*(None,) * 15, *("ambiguous",) * 30)


def test_loops_that_odometry_supports_stand_against_a_twin_within_reach():
    rng = np.random.default_rng(3)
    true, false = loops_of(rng)
    found = screen_loops(drifting_chain(rng), [*true, *false], 4.7, 1.5)
    assert 4.7 < np.median(found.distances[15:]) < LIMIT
    assert found.reasons[:15] == (None,) * 15
    assert set(found.reasons[15:]) <= {"ambiguous", "inconsistent"}


def test_loops_to_a_twin_within_reach_are_withheld_where_there_are_no_others():
    rng = np.random.default_rng(3)
    _, false = loops_of(rng)
    found = screen_loops(drifting_chain(rng, sigma=0.3), false[:15], 4.7, 1.5)
    assert found.distances.max() < LIMIT
    assert set(found.reasons) == {"ambiguous"}


@pytest.mark.parametrize("slip, reason", [(0.4, None), (1.5, "ambiguous")])
def test_a_slip_within_a_place_parts_no_loops(slip, reason):
    """Odometry slips between two keyframes and does not know it: loops before and after do not close a cycle."""
    truth, rng = ring(60, 2), np.random.default_rng(6)
    loops = measure(truth, [(k, k + 30) for k in range(10, 20)], rng)
    slipped = make_transform(np.eye(3), [slip, 0.0, 0.0])
    edges = [
        Edge(e.from_key, e.to_key, slipped @ e.T_from_to, e.covariance) if e.from_key == 45 else e
        for e in measure_odometry(truth, rng)
    ]
    edges[25] = Edge(25, 26, edges[25].T_from_to, np.eye(6))  # known not to know where the second lap begins
    assert set(screen_loops(OdometryChain(range(60), edges), loops, 4.7, 1.5).reasons) == {reason}


def test_one_false_loop_does_not_bring_down_many():
    rng = np.random.default_rng(4)
    true, false = loops_of(rng)
    found = screen_loops(drifting_chain(rng), [*true, false[20]], 4.7, 1.5)
    assert found.reasons == (*(None,) * 15, "ambiguous")


def test_one_false_loop_says_nothing_of_other_places():
    """It puts a view of the corridor into the room; loops between the corridor and the room's first visit stand."""
    rng = np.random.default_rng(5)
    true, _ = loops_of(rng)
    others = measure(TRUTH, list(zip(range(10), range(15, 25), strict=True)), rng)
    moved = TRUTH.copy()
    moved[20, :3, 3] += APART
    false = measure(moved, [(20, 55)], rng)
    found = screen_loops(drifting_chain(rng), [*true, *others, *false], 4.7, 1.5)
    assert found.reasons == (*(None,) * 25, "ambiguous")


@pytest.mark.parametrize(
    ("true", "false", "expected"),
    [
        (15, 15, ("ambiguous", "ambiguous")),
        (15, 4, (None, "ambiguous")),
        (4, 15, ("ambiguous", None)),
        (6, 1, (None, "ambiguous")),
        (1, 1, ("ambiguous", "ambiguous")),
        (15, 0, (None, None)),
    ],
)
def test_maps_that_odometry_does_not_join_are_joined_by_loops_that_others_do_not_contradict(true, false, expected):
    rng = np.random.default_rng(6)
    chain = OdometryChain(range(65), [edge for edge in measure_odometry(TRUTH, rng) if edge.from_key != 39])
    right, wrong = loops_of(rng)
    found = screen_loops(chain, [*right[:true], *wrong[15 : 15 + false]], 4.7, 1.5).reasons
    assert found == (expected[0],) * true + (expected[1],) * false
    assert screen_loops(chain, right, 4.7, 1.5).distances.max() == 0


def test_loops_anywhere_that_place_a_map_alike_count_together():
    rng = np.random.default_rng(8)
    chain = OdometryChain(range(65), [edge for edge in measure_odometry(TRUTH, rng) if edge.from_key != 39])
    right, wrong = loops_of(rng)
    corridor = measure(TRUTH, [(24 - step, 40 + step) for step in range(10)], rng)
    assert set(screen_loops(chain, [*right, *wrong[15:23]], 4.7, 1.5).reasons) == {"ambiguous"}
    found = screen_loops(chain, [*right, *corridor, *wrong[15:23]], 4.7, 1.5).reasons
    assert found == (*(None,) * 25, *("ambiguous",) * 8)


def test_loops_into_another_map_say_nothing_of_those_within_one():
    rng = np.random.default_rng(7)
    chain = OdometryChain(range(65), [edge for edge in measure_odometry(TRUTH, rng) if edge.from_key not in (9, 39)])
    right, wrong = loops_of(rng)
    loops = [*right[:5], *wrong[15:20]]  # of the same views, but into two maps
    assert screen_loops(chain, loops, 4.7, 1.5).reasons == (None,) * 10


def test_no_loops_and_maps_apart_are_no_error():
    chain = OdometryChain(range(4), [])
    assert screen_loops(chain, [], 4.7, 1.5).reasons == ()
    assert not len(screen_loops(chain, [], 4.7, 1.5).eligible)
    far = [Edge(0, 3, make_transform(np.eye(3), [9.0, 0, 0]), np.eye(6)), Edge(1, 3, np.eye(4), np.eye(6))]
    assert screen_loops(chain, far, 4.7, 1.5).reasons == (None, None)


def test_twin_rooms_do_not_make_odometry_look_worse():
    rng = np.random.default_rng(5)
    _, false = loops_of(rng)
    chain = OdometryChain(range(len(TRUTH)), measure_odometry(TRUTH, rng))
    assert cycle_scale(chain, false[:15], 10.0) == 1.0
    drifting = OdometryChain(range(len(TRUTH)), measure_odometry(TRUTH, rng, 5.0))
    assert cycle_scale(drifting, false[:15], 10.0) > 2.0
    assert cycle_scale(chain, [], 10.0) == cycle_scale(chain, false[:2], 10.0) == 1.0


def test_one_noisy_pair_does_not_split_a_group_in_two():
    truth, rng = ring(240, 4), np.random.default_rng(0)
    pairs = [(k - 60, k) for k in range(60, 240, 4)]
    loops = measure(truth, pairs, rng, 1.0, np.array([0.01] * 3 + [0.02] * 3))
    chain = OdometryChain(range(240), measure_odometry(truth, rng))
    assert set(screen_loops(chain, loops, LIMIT / 1.5, 1.5).reasons) == {None}


def test_odometry_that_has_lost_its_heading_contradicts_no_loop():
    """Beyond half a radian a covariance to first order is too small on the far side of the way; doubt ends at one."""
    far = [Edge(0, 14, make_transform(np.eye(3), [40.0, 0.0, 0.0]), 1e-4 * np.eye(6))]

    def found(turn):
        covariance = np.diag([turn**2] * 3 + [1e-4] * 3)
        odometry = [Edge(k, k + 1, make_transform(np.eye(3), [0.3, 0.0, 0.0]), covariance) for k in range(14)]
        return screen_loops(OdometryChain(range(15), odometry), far, 4.7, 1.5).reasons

    assert found(0.01) == ("inconsistent",)
    assert found(0.1) == ("ambiguous",)
    assert found(0.2) == (None,)
