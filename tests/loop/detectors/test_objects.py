"""Object submaps: up, objects and walls, and the pose that two submaps agree on."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.datasets.synthetic import SyntheticDataset
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.geometry.se3 import FloatArray, exp_so3, invert, make_transform, rotation_angle
from semslam.loop.detectors.objects.components import connected_components
from semslam.loop.detectors.objects.detector import ObjectsDetector
from semslam.loop.detectors.objects.labelled import GROUP_COUNT, GROUP_LIST, group_of_names, label_cloud
from semslam.loop.detectors.objects.matching import match_submaps
from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.loop.detectors.objects.submap import Objects, Submap, build_submap, quantised
from semslam.loop.detectors.objects.upright import find_up, level_frame
from semslam.loop.detectors.objects.walls import BINS, Walls
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.types import KeyframeView, LabelMap

CONFIG = ObjectsConfig()
STEP = 8
LIMIT_BYTES = 4096


@pytest.fixture(scope="module")
def views() -> list[KeyframeView]:
    """Keyframes of one room with exact labels and poses, in a frame that is not level."""
    dataset = open_dataset("synthetic:room?frames=96&width=160")
    assert isinstance(dataset, SyntheticDataset)
    builder = KeyframeBuilder(Config(), details=False)
    poses = dataset.ground_truth.poses
    start = make_transform(exp_so3([0.3, -0.2, 0.5]), [0.0, 0.0, 0.0])
    views = []
    for index in range(0, len(dataset), STEP):
        frame = dataset.frame(index)
        keyframe = builder.build_at(frame, start @ poses[index])
        views.append(KeyframeView(keyframe, frame.color, frame.depth, LabelMap(dataset.labels(index), NYU40_NAMES)))
    return views


def submap_of(views: list[KeyframeView], config: ObjectsConfig = CONFIG) -> Submap:
    looks = np.ones((4, 3), dtype=np.float32)
    return build_submap([label_cloud(view, looks, (2, 2), 5.0, 0.0) for view in views], config)


def test_up_is_that_of_the_room(views: list[KeyframeView]) -> None:
    looks = np.ones((1, 3), dtype=np.float32)
    clouds = [label_cloud(view, looks, (1, 1), 5.0, 0.0) for view in views]
    true = exp_so3([0.3, -0.2, 0.5])[:, 2]
    assert np.degrees(np.arccos(find_up(clouds) @ true)) < 1.5


def test_without_level_surfaces_the_cameras_are_taken_for_level(views: list[KeyframeView]) -> None:
    view = views[0]
    wall = LabelMap(np.zeros_like(view.labels.labels), NYU40_NAMES) if view.labels else None
    cloud = label_cloud(
        KeyframeView(view.keyframe, view.color, view.depth, wall), np.ones((1, 3), np.float32), (1, 1), 0.1, 0
    )
    assert find_up([cloud]) == pytest.approx(-view.keyframe.T_odom_cam[:3, 1])
    for look in (view.keyframe.T_odom_cam, make_transform(exp_so3([np.pi / 2, 0, 0]), [1, 2, 3])):
        level = level_frame(look, np.array([0.0, 0.0, 1.0]))
        assert level[:3, 2] == pytest.approx([0, 0, 1])
        assert np.linalg.det(level[:3, :3]) == pytest.approx(1)


def test_a_room_has_floor_walls_and_things(views: list[KeyframeView]) -> None:
    submap = submap_of(views)
    assert np.isnan(submap.floor)  # the camera looks too high to see it
    assert len(submap.walls) >= 3
    kinds = {GROUP_LIST[group] for group in submap.objects.groups}
    assert {"table", "storage"} <= kinds
    assert sum(array.nbytes for array in submap.to_arrays().values()) <= LIMIT_BYTES
    again = submap_of(views)
    assert again.objects.centroids.tobytes() == submap.objects.centroids.tobytes()


def test_halves_of_one_room_find_their_pose(views: list[KeyframeView]) -> None:
    ours, theirs = submap_of(views[5:]), submap_of(views[:9])
    (found,) = match_submaps(ours, [theirs], CONFIG)
    assert found is not None
    T = theirs.T_cam_level @ found.T_match_query @ invert(ours.T_cam_level)
    true = invert(views[8].keyframe.T_odom_cam) @ views[-1].keyframe.T_odom_cam
    error = invert(true) @ T
    assert np.linalg.norm(error[:3, 3]) < 0.2
    assert np.degrees(rotation_angle(error)) < 5


def furnished(T: FloatArray, seed: int, objects: int = 12) -> Submap:
    """Things and four walls of a room of 5 x 4 m seen from T (4, 4), level."""
    rng = np.random.default_rng(seed)
    points = rng.uniform([-2.4, -1.9, -1.2], [2.4, 1.9, 0.6], (objects, 3))
    groups = rng.integers(4, len(GROUP_LIST), objects)
    world = points @ T[:3, :3].T + T[:3, 3]
    turn = np.arctan2(T[1, 0], T[0, 0])
    angles = np.arange(4) * np.pi / 2 + turn
    lengths, distances = np.array([2.0, 2.5, 2.0, 2.5]), np.array([2.5, 2.0, 2.5, 2.0])
    normals = np.stack([np.cos(angles), np.sin(angles)], 1)
    tangents = np.stack([-np.sin(angles), np.cos(angles)], 1)
    along = tangents @ T[:2, 3]
    table = np.zeros((GROUP_COUNT, BINS))
    for k, angle in enumerate(angles):
        table[1 + k % 2, int(np.floor((angle + np.pi) / (2 * np.pi) * BINS)) % BINS] = lengths[k]
    columns = (angles + np.pi, distances - normals @ T[:2, 3], -along - lengths, lengths - along, 8 * lengths)
    return Submap(
        0.0, np.eye(4), -1.3 + T[2, 3],
        Objects(
            world.astype(np.float32), np.ones((objects, 2), np.float32), np.full(objects, 50, np.float32),
            groups.astype(np.uint8), quantised(np.eye(GROUP_COUNT)[groups]), quantised(rng.normal(size=(objects, 8))),
        ),
        Walls(*(column.astype(np.float32) for column in columns)),
        quantised(table), np.zeros(3 * GROUP_COUNT, np.float32),
    )  # fmt: skip


@settings(max_examples=25)
@given(
    turn=st.floats(-np.pi, np.pi),
    shift=st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-0.5, 0.5)),
    seed=st.integers(0, 5),
)
def test_any_turn_and_shift_is_found(turn: float, shift: tuple[float, float, float], seed: int) -> None:
    T = make_transform(exp_so3([0, 0, turn]), shift)
    (found,) = match_submaps(furnished(np.eye(4), seed), [furnished(T, seed)], CONFIG)
    assert found is not None
    error = invert(T) @ found.T_match_query
    assert np.linalg.norm(error[:3, 3]) < 0.15
    assert np.degrees(rotation_angle(error)) < 3
    assert found.score > 0.6
    assert len(found.objects) >= 10


def test_another_room_matches_less_and_nothing_matches_nothing() -> None:
    room = furnished(np.eye(4), 0)
    same, other = match_submaps(room, [furnished(np.eye(4), 0), furnished(np.eye(4), 1)], CONFIG)
    assert same is not None
    assert other is None or other.score < 0.7 * same.score
    bare = furnished(np.eye(4), 0, objects=0)
    assert match_submaps(bare, [bare, bare], CONFIG.model_copy(update={"use_structure": False})) == [None, None]
    assert match_submaps(room, [], CONFIG) == []


def test_unknown_class_names_have_groups_too() -> None:
    groups = group_of_names(("void", "wall", "sofa", "dragon", "unicorn"))
    assert groups[0] == 0
    assert GROUP_LIST[groups[1]] == "wall"
    assert len({int(group) for group in groups}) == 5
    assert groups.max() < GROUP_COUNT


def test_submaps_of_a_loop_are_apart_in_time(views: list[KeyframeView]) -> None:
    config = Config().with_changes(
        loops={"min_gap": 2.0, "min_score": 0.0}, objects={"max_age": 3.0, "min_keyframes": 1}
    )
    detector = ObjectsDetector.from_config(config)
    proposed = 0
    for view in views:
        for candidate in detector.query(view):
            assert candidate.guess is not None
            began, ended = (views[i].keyframe.timestamp for i in (candidate.guess.query[0], candidate.guess.match[-1]))
            assert began - ended >= config.loops.min_gap, "what went on from one to the next is no loop"
            assert candidate.guess.query[-1] == view.keyframe.id
            assert len(candidate.evidence.objects) == candidate.evidence.figures["matched_objects"]
            proposed += 1
        detector.add(view)
    assert proposed


@pytest.mark.parametrize("limit", ["min_objects", "min_keyframes"])
def test_few_matched_objects_or_keyframes_make_no_candidate(views: list[KeyframeView], limit: str) -> None:
    changes = {"loops": {"min_gap": 2.0, "min_score": 0.0}, "objects": {"max_age": 3.0, limit: 30}}
    detector = ObjectsDetector.from_config(Config().with_changes(**changes))
    for view in views:
        assert detector.query(view) == []
        detector.add(view)


@settings(max_examples=25)
@given(seed=st.integers(0, 1000), count=st.integers(0, 200))
def test_components_are_those_of_each_group(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    cells = np.unique(rng.integers(-4, 4, (count, 3)), axis=0)
    winners = rng.integers(0, 7, len(cells))
    owners = connected_components(cells, winners)
    assert ((owners < 0) == (winners < 4)).all()
    total = 0
    for group in range(4, 7):
        grid = np.zeros((8, 8, 8), dtype=bool)
        own = cells[winners == group] + 4
        grid[tuple(own.T)] = True
        labels, found = ndimage.label(grid, structure=np.ones((3, 3, 3)))
        assert owners[winners == group].tolist() == (total + labels[tuple(own.T)] - 1).tolist()
        total += found


def test_a_damaged_submap_is_refused() -> None:
    arrays = dict(furnished(np.eye(4), 0).to_arrays())
    assert Submap.from_arrays(arrays).floor == pytest.approx(-1.3)
    with pytest.raises(ValueError, match="submap"):
        Submap.from_arrays(arrays | {"objects_sizes": np.zeros(3)})
    del arrays["content"]
    with pytest.raises(KeyError):
        Submap.from_arrays(arrays)


def test_without_labels_things_are_what_is_no_structure(views: list[KeyframeView]) -> None:
    bare = CONFIG.model_copy(update={"use_labels": False})
    submap = submap_of(views, bare)
    assert 0 < len(submap.objects) < len(submap_of(views).objects)
    assert len(set(submap.objects.groups.tolist())) == 1
    assert match_submaps(submap, [submap_of(views[:9], bare)], bare)[0] is not None
