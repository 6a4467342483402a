"""A closer that forgets, saves, loads and answers queries."""

import json
from dataclasses import replace
from pathlib import Path

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X

from semslam import LoopCloser
from semslam.config import Config, load_config
from semslam.errors import ConfigError, GraphError, ResultsError
from semslam.geometry.se3 import invert
from semslam.loop.segmentation.shipped import INT8_GRAPH
from semslam.system import finder
from semslam.system.database import read_database
from semslam.system.finder import memory_source

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
LOOSE = {"min_gap": 1.0, "min_score": 0.0, "follow": 1}
COUNT = 8


@pytest.fixture(scope="module")
def room():
    """The examples' room: its module's functions."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(EXAMPLES))
        import box_room

        yield box_room


@pytest.fixture(scope="module")
def frames(room):
    """Keyframes, half a second apart, of a camera that turns slowly."""
    return list(room.frames(room.poses()[: 3 * COUNT : 3]))


def make(room, detector="dbow", worker="none", **settings) -> LoopCloser:
    return LoopCloser(room.CAMERA, detector, Config().with_changes(loops=LOOSE, **settings), worker=worker)


def add(closer: LoopCloser, frames, first: int = 0) -> list[gtsam.BetweenFactorPose3]:
    factors = []
    for number, frame in enumerate(frames, first):
        factors += closer.add(X(number), frame.color, frame.depth, np.eye(4), timestamp=0.5 * number)
    return factors + closer.poll(wait=True)


def ends(factors) -> set[tuple[int, int]]:
    return {tuple(factor.keys()) for factor in factors}


def test_a_query_finds_places_and_adds_nothing(room, frames):
    closer = make(room)
    add(closer, frames)
    before = closer.closures
    found = closer.query(frames[2].color, frames[2].depth)
    assert X(2) in {match.match_key for match in found}
    here = next(match for match in found if match.match_key == X(2))
    assert np.abs(here.T_match_query - np.eye(4)).max() < 0.01
    assert closer.closures == before
    again = closer.query(frames[2].color, frames[2].depth)
    assert [m.T_match_query.tobytes() for m in again] == [m.T_match_query.tobytes() for m in found]


def test_a_query_of_a_body(room, frames):
    T_body_cam = room.poses()[5]
    config = Config().with_changes(loops=LOOSE)
    camera, body = (LoopCloser(room.CAMERA, "dbow", config, T_body_cam=T) for T in (None, T_body_cam))
    for closer in (camera, body):
        add(closer, frames)
    seen, carried = (closer.query(frames[3].color, frames[3].depth)[0] for closer in (camera, body))
    np.testing.assert_allclose(carried.T_match_query, T_body_cam @ seen.T_match_query @ invert(T_body_cam), atol=1e-9)


@pytest.mark.parametrize("worker", ["none", "process"])
def test_forgotten_keyframes_are_found_no_more(room, frames, worker):
    closer = make(room, worker=worker)
    add(closer, frames)
    closer.forget([X(2), X(3)])
    found = {match.match_key for match in closer.query(frames[2].color, frames[2].depth)}
    later = add(closer, [frames[2], frames[5]], COUNT + 2)
    assert X(2) not in found
    assert X(3) not in found
    matched = {factor.keys()[0] for factor in later}
    assert X(5) in matched
    assert not {X(2), X(3)} & matched
    closer.close()


def test_what_cannot_be_forgotten_changes_nothing(room, frames):
    closer = make(room)
    add(closer, frames[:3])
    closer.forget([X(0)])
    for key in (X(0), X(7)):
        with pytest.raises(GraphError, match="There is no keyframe of the key"):
            closer.forget([X(1), key])
    assert {m.match_key for m in closer.query(frames[1].color, frames[1].depth)} >= {X(1)}
    with pytest.raises(GraphError, match="was added before"):
        closer.add(X(0), frames[0].color, frames[0].depth)


@pytest.mark.parametrize("worker", ["none", "process"])
def test_a_saved_closer_goes_on_as_the_first_would_have(room, frames, worker, tmp_path):
    path = tmp_path / "rooms.npz"
    first = make(room)
    add(first, frames[:6])
    first.forget([X(1)])
    first.save(path)
    second = make(room, worker=worker)
    second.load(path)
    assert second.closures == ()
    asked = [closer.query(frames[2].color, frames[2].depth) for closer in (first, second)]
    assert asked[0]
    assert len({tuple((m.match_key, m.T_match_query.tobytes()) for m in found) for found in asked}) == 1
    assert X(1) not in {match.match_key for match in asked[1]}
    assert ends(add(second, [frames[2]], 20))
    with pytest.raises(GraphError, match="before the first keyframe"):
        second.load(path)
    with pytest.raises(GraphError, match="was added before"):
        second.add(X(0), frames[0].color, frames[0].depth)
    second.close()


def test_a_loaded_closer_knows_which_places_are_closed(room, frames, tmp_path):
    first, second = make(room), make(room)
    add(first, frames[:6])
    factors = add(first, [frames[2]], 20)
    first.save(tmp_path / "first.npz")
    numbers = {X(number): number for number in range(6)} | {X(20): 6}
    closed = read_database(tmp_path / "first.npz").memory.closed
    assert set(closed) == {(numbers[query], numbers[match]) for match, query in ends(factors)}
    second.load(tmp_path / "first.npz")
    second.save(tmp_path / "second.npz")
    assert (tmp_path / "second.npz").read_bytes() == (tmp_path / "first.npz").read_bytes()


def test_equal_closers_are_equal_bytes_and_an_empty_one_can_be_saved(room, frames, tmp_path):
    for name in ("a", "b"):
        closer = make(room)
        add(closer, frames[:2])
        closer.save(tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    make(room).save(tmp_path / "empty")
    other = make(room)
    other.load(tmp_path / "empty")
    assert other.query(frames[0].color, frames[0].depth) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", "empty"]


def test_another_detector_or_other_settings_are_refused(room, frames, tmp_path, monkeypatch):
    path = tmp_path / "rooms.npz"
    closer = make(room)
    add(closer, frames[:2])
    closer.save(path)
    with pytest.raises(ConfigError, match="detector 'dbow', not 'thumbnail'"):
        make(room, "thumbnail").load(path)
    with pytest.raises(ConfigError, match="other settings of 'dbow'"):
        make(room, dbow={"group": 0.1}).load(path)
    monkeypatch.setattr(finder, "digest_of_weights", lambda _others: "learned anew")
    with pytest.raises(ConfigError, match="other learned weights"):
        make(room).load(path)


def test_memory_depends_on_the_settings_and_weights_of_all_its_parts(tmp_path):
    weights = tmp_path / "own.onnx"
    weights.write_bytes(INT8_GRAPH.read_bytes())
    own = {"segmentation": {"weights": str(weights)}}
    sources = [
        memory_source(None, load_config(overrides=changes))
        for changes in ({}, {"objects": {"voxel": 0.2}}, {"fused": {"word_share": 0.2}}, own)
    ]
    weights.write_bytes(b"another network")
    sources.append(memory_source(None, load_config(overrides=own)))
    assert len(set(sources)) == len(sources)
    assert sources[-1].settings == sources[-2].settings


def test_a_damaged_file_is_one_sentence_whatever_byte_is_wrong(room, frames, tmp_path):
    whole, path = tmp_path / "whole", tmp_path / "damaged"
    closer = make(room)
    add(closer, frames[:2])
    closer.save(whole)
    content, expected = whole.read_bytes(), read_database(whole)
    rng = np.random.default_rng(0)
    for place in rng.integers(0, len(content), 60).tolist():
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x55]) + content[place + 1 :])
        try:
            found = read_database(path)
        except ResultsError:
            continue
        assert found.keys == expected.keys  # a byte that zip does not need
        for one, other in zip(found.memory.keyframes, expected.memory.keyframes, strict=True):
            assert one.features.pixels.tobytes() == other.features.pixels.tobytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(ResultsError, match="damaged"):
        make(room).load(path)


def test_files_of_other_kinds_are_refused(room, tmp_path):
    closer = make(room)
    with pytest.raises(ResultsError, match="cannot be read"):
        closer.load(tmp_path / "none")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(ResultsError, match="is no loop database"):
        closer.load(tmp_path / "other.npz")
    header = {"kind": "semslam loop database", "version": 99}
    np.savez(tmp_path / "newer.npz", header=np.array(json.dumps(header)), checksum=np.array(""))
    with pytest.raises(ResultsError, match="of version 99"):
        closer.load(tmp_path / "newer.npz")


def test_a_place_that_cannot_be_written_is_one_sentence(room, tmp_path):
    with pytest.raises(ResultsError, match="cannot be written"):
        make(room).save(tmp_path / "nowhere" / "rooms.npz")


class Plain:
    """A detector of one's own that keeps nothing which could be forgotten."""

    name = "plain"
    needs_labels = False

    def query(self, view):
        return []

    def add(self, view):
        pass


def test_a_detector_that_cannot_forget_is_named(room, tmp_path):
    closer = LoopCloser(room.CAMERA, Plain())
    for call in (lambda: closer.forget([]), lambda: closer.save(tmp_path / "a"), lambda: closer.load(tmp_path / "a")):
        with pytest.raises(ConfigError, match="'plain' cannot forget keyframes"):
            call()


def test_looks_of_another_detector_leave_the_closer_empty(room, frames, tmp_path):
    path = tmp_path / "rooms.npz"
    closer = make(room)
    add(closer, frames[:3])
    closer.save(path)
    other = make(room, "semantic")
    database = read_database(path)
    with pytest.raises((KeyError, ValueError)):
        other._worker.submit(lambda finder: finder.recall(replace(database.memory))).result()
    assert other._worker.submit(lambda finder: finder.memory()).result().keyframes == ()
