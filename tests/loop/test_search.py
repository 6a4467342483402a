"""The search as a whole: which candidates are verified, with what, and what becomes of the others."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from semslam.config import LoopConfig
from semslam.geometry.camera import Intrinsics
from semslam.loop.detector import Look
from semslam.loop.redundancy import NEIGHBOURHOOD, ClosedPlaces
from semslam.loop.search import LoopSearch
from semslam.types import (
    Cloud,
    Features,
    Frame,
    Keyframe,
    KeyframeView,
    LoopCandidate,
    LoopConstraint,
    LoopRejection,
    RejectionReason,
    SubmapGuess,
)

CAMERA = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
FIRST = 10


class EveryOldOne:
    """Proposes each of the first keyframes for every later one."""

    needs_labels = False

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        late = view.keyframe.id >= FIRST
        return [LoopCandidate(view.keyframe.id, match, 0.5, "every") for match in range(FIRST) if late]

    def add(self, view: KeyframeView) -> None:
        pass


class Forgetful(EveryOldOne):
    """Proposes every keyframe that it was not told to forget."""

    def __init__(self) -> None:
        self.kept: list[int] = []

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        return [LoopCandidate(view.keyframe.id, match, 0.5, "every") for match in self.kept]

    def add(self, view: KeyframeView) -> None:
        self.kept.append(view.keyframe.id)

    def forget(self, ids: Collection[int]) -> None:
        self.kept = [id for id in self.kept if id not in ids]

    def looks(self) -> tuple[Look, ...]:
        return ()

    def recall(self, looks: Sequence[Look]) -> None:
        pass


@dataclass
class Standing:
    """Confirms every candidate, between other keyframes where ``between`` is set: the camera has not moved."""

    asked: list[LoopCandidate] = field(default_factory=list)
    between: tuple[int, int] | None = None

    def verify(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> LoopConstraint:
        self.asked.append(candidate)
        return LoopConstraint(candidate, np.eye(4), np.eye(6), 1.0, 0.0, 1.0, 50, "exact", between=self.between)


def keyframe(number: int, map_id: int = 0) -> Keyframe:
    empty = np.zeros((0, 2), np.float32)
    bytes_, none = np.zeros((0, 32), np.uint8), empty[:, 0]
    features = Features(empty, none, none.astype(np.uint8), none, bytes_, np.zeros((0, 3), np.float32))
    cloud = Cloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32))
    return Keyframe(number, number, float(number), np.eye(4), map_id, CAMERA, features, cloud)


def search(
    config: LoopConfig, maps: list[int], between: tuple[int, int] | None = None
) -> tuple[Standing, list[list[LoopConstraint | LoopRejection]]]:
    verifier = Standing(between=between)
    search = LoopSearch(EveryOldOne(), None, verifier, config)  # type: ignore[arg-type]
    images = np.zeros((48, 64, 3), np.uint8), np.zeros((48, 64), np.float32)
    found = [
        search.search(keyframe(number, map_id), Frame(number, float(number), *images, CAMERA))
        for number, map_id in enumerate(maps)
    ]
    return verifier, found


def closed(outcomes: list[LoopConstraint | LoopRejection]) -> list[int]:
    return [one.candidate.match for one in outcomes if isinstance(one, LoopConstraint)]


def test_two_loops_between_two_places_are_enough_and_the_others_are_recorded_as_redundant() -> None:
    verifier, found = search(LoopConfig(follow=0, per_place=2), [0] * (FIRST + NEIGHBOURHOOD + 2))
    assert closed(found[FIRST]) == [0, 1, 3, 4, 6, 7, 9], "one that lies within two keyframes of two loops is left out"
    for outcomes in found[FIRST + 1 : FIRST + NEIGHBOURHOOD + 1]:
        assert closed(outcomes) == []
        assert len(outcomes) == FIRST, "none is dropped in silence"
        assert {one.reason for one in outcomes if isinstance(one, LoopRejection)} == {RejectionReason.REDUNDANT}
    assert closed(found[-1]), "later keyframes are another place in time"
    assert len(verifier.asked) == sum(len(closed(outcomes)) for outcomes in found)


def test_zero_sets_no_maximum() -> None:
    verifier, found = search(LoopConfig(follow=0, per_place=0), [0] * (FIRST + 3))
    assert [len(closed(outcomes)) for outcomes in found[FIRST:]] == [FIRST] * 3
    assert len(verifier.asked) == 3 * FIRST


def test_loops_of_another_map_close_nothing_for_this_one() -> None:
    _, found = search(LoopConfig(follow=0, per_place=2), [0] * (FIRST + 1) + [1])
    assert closed(found[-1]) == closed(found[FIRST]), "a new map needs its own loops"


def test_later_candidates_are_verified_with_a_prediction_that_the_outcome_does_not_keep() -> None:
    verifier, found = search(LoopConfig(follow=0, per_place=2), [0] * (FIRST + 1))
    assert [candidate.prediction is None for candidate in verifier.asked] == [True] + [False] * 6
    assert all(outcome.candidate.prediction is None for outcome in found[FIRST])


def test_no_two_loops_are_between_the_same_keyframes_though_their_candidates_differ() -> None:
    for per_place in (0, 4):
        verifier, found = search(LoopConfig(follow=3, per_place=per_place), [0] * (FIRST + 2), between=(8, 2))
        loops = [one for outcomes in found for one in outcomes if isinstance(one, LoopConstraint)]
        assert [(loop.query, loop.match) for loop in loops] == [(8, 2)]
        assert len(verifier.asked) > 1
        rejected = [one for outcomes in found for one in outcomes if isinstance(one, LoopRejection)]
        assert {one.reason for one in rejected} == {RejectionReason.REDUNDANT}


def test_submaps_are_not_registered_where_the_views_that_share_their_surface_are_joined_already() -> None:
    """Keyframes 4 and 12 alone see anything, so that a loop of the submaps around 6 and 14 is between them."""

    class ViewsThenSubmaps(EveryOldOne):
        def query(self, view: KeyframeView) -> list[LoopCandidate]:
            guess = SubmapGuess(tuple(map(tuple, np.eye(4).tolist())), (12, 13, 14), (4, 5, 6))
            found = {
                12: [LoopCandidate(12, joined, 0.5, "views")],
                14: [LoopCandidate(14, 6, 0.5, "submaps", guess=guess)],
            }
            return found.get(view.keyframe.id, [])

    wall = np.column_stack([np.indices((9, 9)).reshape(2, -1).T * 0.1, np.full(81, 2.0)]).astype(np.float32)
    seen = Cloud(wall, np.tile(np.float32([0, 0, -1]), (81, 1)))
    images = np.zeros((48, 64, 3), np.uint8), np.zeros((48, 64), np.float32)
    for joined, asked in ((4, [12]), (0, [12, 14])):
        verifier = Standing()
        search = LoopSearch(ViewsThenSubmaps(), None, verifier, LoopConfig(follow=0, per_place=1))  # type: ignore[arg-type]
        for number in range(15):
            view = replace(keyframe(number), cloud=seen) if number in (4, 12) else keyframe(number)
            outcomes = search.search(view, Frame(number, float(number), *images, CAMERA))
        assert [candidate.query for candidate in verifier.asked] == asked
        assert [isinstance(one, LoopRejection) for one in outcomes] == [joined == 4]


def test_views_are_verified_before_submaps_whatever_their_scores_are() -> None:
    class SureOfSubmaps(EveryOldOne):
        def query(self, view: KeyframeView) -> list[LoopCandidate]:
            guess = SubmapGuess(tuple(map(tuple, np.eye(4).tolist())), (FIRST,), (5,))
            submap = LoopCandidate(FIRST, 5, 0.9, "submaps", guess=guess)
            views = [LoopCandidate(FIRST, match, score, "views") for match, score in ((8, 0.6), (2, 0.5))]
            return [submap, *views] if view.keyframe.id == FIRST else []

    verifier = Standing()
    search = LoopSearch(SureOfSubmaps(), None, verifier, LoopConfig(follow=0, per_place=0))  # type: ignore[arg-type]
    images = np.zeros((48, 64, 3), np.uint8), np.zeros((48, 64), np.float32)
    for number in range(FIRST + 1):
        search.search(keyframe(number), Frame(number, float(number), *images, CAMERA))
    assert [candidate.match for candidate in verifier.asked] == [8, 2, 5]


def test_a_place_is_found_once_where_a_view_and_a_submap_name_it() -> None:
    class Both(EveryOldOne):
        def query(self, view: KeyframeView) -> list[LoopCandidate]:
            guess = SubmapGuess(tuple(map(tuple, np.eye(4).tolist())), (FIRST,), (5,))
            both = [LoopCandidate(FIRST, 5, 0.9, "both", guess=guess), LoopCandidate(FIRST, 5, 0.6, "both")]
            return both if view.keyframe.id == FIRST else []

    search = LoopSearch(Both(), None, Standing(), LoopConfig(follow=0))  # type: ignore[arg-type]
    images = np.zeros((48, 64, 3), np.uint8), np.zeros((48, 64), np.float32)
    frames = [Frame(number, float(number), *images, CAMERA) for number in range(FIRST + 1)]
    for number in range(FIRST):
        search.search(keyframe(number), frames[number])
    view, submap = search.find(keyframe(FIRST), frames[FIRST])
    assert isinstance(view, LoopConstraint)
    assert isinstance(submap, LoopRejection)
    assert submap.reason is RejectionReason.REDUNDANT


@pytest.mark.parametrize("per_place", [0, 2])
def test_beyond_a_number_of_keyframes_those_that_say_nothing_new_are_not_kept(per_place: int) -> None:
    detector, verifier = Forgetful(), Standing()
    config = LoopConfig(follow=0, per_place=per_place, thin_beyond=5)
    search = LoopSearch(detector, None, verifier, config)  # type: ignore[arg-type]
    images = np.zeros((48, 64, 3), np.uint8), np.zeros((48, 64), np.float32)
    for number in range(9):
        search.search(keyframe(number), Frame(number, float(number), *images, CAMERA))
    assert detector.kept == [0, 1, 2, 3, 4]
    assert [search.keeps(number) for number in range(9)] == [True] * 5 + [False] * 4


def test_a_keyframe_that_stands_elsewhere_is_kept() -> None:
    class Apart(Standing):
        def verify(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> LoopConstraint:
            moved = np.eye(4)
            moved[0, 3] = 0.5
            return replace(super().verify(query, match, candidate), T_match_query=moved)

    detector = Forgetful()
    search = LoopSearch(detector, None, Apart(), LoopConfig(follow=0, per_place=0, thin_beyond=5))  # type: ignore[arg-type]
    images = np.zeros((48, 64, 3), np.uint8), np.zeros((48, 64), np.float32)
    for number in range(9):
        search.search(keyframe(number), Frame(number, float(number), *images, CAMERA))
    assert detector.kept == list(range(9))


def test_a_loop_touches_two_submaps_where_it_joins_neighbours_of_any_of_their_keyframes() -> None:
    closed = ClosedPlaces()
    closed.recall([(20, 5)])
    assert closed.touch([16, 17, 18], [7, 8])
    assert closed.touch([22, 23], [1, 2, 3])
    assert not closed.touch([15, 16, 17], [7, 8]), "the query is three keyframes off"
    assert not closed.touch([16, 17, 18], [8, 9]), "the match is"
    assert not ClosedPlaces().touch([20], [5])
