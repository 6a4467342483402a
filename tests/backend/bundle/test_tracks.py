"""Chains of matched features become landmarks, whatever the order in which they are given."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.backend.bundle.tracks import MatchedFeatures, join_tracks
from semslam.types import Features


def features(count: int, first: int = 0) -> Features:
    """Keypoints whose column and depth tell which they are."""
    number = np.arange(first, first + count, dtype=np.float32)
    zeros = np.zeros(count, np.float32)
    return Features(
        np.column_stack([number, zeros]), number + 1, zeros.astype(np.uint8), zeros, np.zeros((count, 32), np.uint8),
        np.zeros((count, 3), np.float32),
    )  # fmt: skip


def match(first: int, second: int, *rows: tuple[int, int]) -> MatchedFeatures:
    return MatchedFeatures(first, second, np.array(rows, dtype=np.int64).reshape(-1, 2))


def test_a_chain_through_three_keyframes_is_one_landmark() -> None:
    frames = {3: features(4), 5: features(4, 10), 9: features(4, 20)}
    seen = join_tracks(frames, [match(5, 3, (0, 2), (1, 1)), match(9, 5, (3, 0))])
    by_landmark = [
        {key: float(one.pixels[list(one.landmarks).index(landmark), 0]) for key, one in seen.items()
         if landmark in one.landmarks}
        for landmark in sorted({int(i) for one in seen.values() for i in one.landmarks})
    ]  # fmt: skip
    assert {3: 2.0, 5: 10.0, 9: 23.0} in by_landmark
    assert {3: 1.0, 5: 11.0} in by_landmark
    assert len(by_landmark) == 2
    np.testing.assert_array_equal(seen[9].depths, [24.0])


def test_a_chain_that_comes_back_elsewhere_is_left_out() -> None:
    frames = {key: features(4) for key in range(3)}
    circle = [match(1, 0, (0, 0), (3, 3)), match(2, 1, (0, 0)), match(2, 0, (0, 1))]
    seen = join_tracks(frames, circle)
    assert [one.pixels[:, 0].tolist() for one in seen.values()] == [[3.0], [3.0], []]


def test_nothing_matched() -> None:
    assert join_tracks({0: features(3), 1: features(3)}, []) == {}
    seen = join_tracks({0: features(3), 1: features(0)}, [match(1, 0)])
    assert all(len(one.landmarks) == 0 for one in seen.values())


@given(st.integers(0, 10_000))
@settings(max_examples=25)
def test_true_matches_give_back_the_landmarks_in_any_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    identities = {key: rng.permutation(12)[: rng.integers(1, 12)] for key in range(4)}
    pairs = []
    for a in range(4):
        for b in range(a):
            _, first, second = np.intersect1d(identities[a], identities[b], return_indices=True)
            pairs.append(MatchedFeatures(a, b, np.column_stack([first, second]).astype(np.int64)))
    shuffled = [pairs[int(i)] for i in rng.permutation(len(pairs))]
    seen = join_tracks({key: features(len(one)) for key, one in identities.items()}, shuffled)
    landmark_of: dict[int, int] = {}
    for key, one in seen.items():
        for landmark, column in zip(one.landmarks.tolist(), one.pixels[:, 0].astype(int).tolist(), strict=True):
            assert landmark_of.setdefault(landmark, int(identities[key][column])) == identities[key][column]
    often = [i for i in range(12) if sum(i in one for one in identities.values()) > 1]
    assert sorted(landmark_of.values()) == often
