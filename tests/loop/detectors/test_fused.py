"""The parts of the fused detector: pooling, class scores, the learned projection, candidates."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.errors import ModelError
from semslam.geometry.se3 import exp_so3, make_transform
from semslam.loop.detectors.bag_of_words.detector import grouped
from semslam.loop.detectors.bag_of_words.word_index import RECENT, WordIndex
from semslam.loop.detectors.common.cosine_index import COMMON_AFTER, WholeIndex
from semslam.loop.detectors.fused.class_index import ClassIndex
from semslam.loop.detectors.fused.fusion import ClassFeatures, FusionModel, load_fusion, pool, pool_classes
from semslam.loop.detectors.fused.photo_views import make_view, overlap
from semslam.loop.detectors.fused.relighting import gamma, noise, relight, shadow, tint
from semslam.loop.detectors.fused.training import DescribedViews, learn_projection, learn_usual, train_fusion
from semslam.loop.detectors.fused.upright import roll_of, turn_image, turn_labels

RNG = np.random.default_rng(0)


def test_pooling_ignores_where_things_are_and_keeps_the_sign() -> None:
    features = RNG.normal(size=(6, 8, 5)).astype(np.float32)
    shuffled = features.reshape(-1, 5)[RNG.permutation(48)].reshape(6, 8, 5)
    np.testing.assert_allclose(pool(features), pool(shuffled), atol=1e-6)
    np.testing.assert_allclose(pool(-features), np.roll(pool(features), 5), atol=1e-6)
    assert np.linalg.norm(pool(features)) == pytest.approx(1, abs=1e-5)


def test_classes_are_averaged_without_void_and_movable_ones_weigh_less() -> None:
    labels = np.zeros((8, 8), np.uint8)
    labels[:4], labels[4:, :4] = 1, 2
    middle = RNG.normal(size=(8, 8, 3)).astype(np.float32)
    features = pool_classes(middle, labels, frozenset({2}))
    assert features.labels.tolist() == [1, 2]
    mean = middle[:4].reshape(-1, 3).mean(axis=0)
    np.testing.assert_allclose(features.vectors[0], mean / np.linalg.norm(mean), atol=1e-5)
    np.testing.assert_allclose(features.shares, [np.sqrt(0.5), 0.5 * np.sqrt(0.25)])
    assert len(pool_classes(middle, np.zeros((8, 8), np.uint8), frozenset()).labels) == 0


def test_classes_count_by_the_share_of_cells_that_they_cover() -> None:
    labels = np.ones((16, 16), np.uint8)
    labels[:, :4], labels[0, 15] = 2, 3  # half of the left cells, and too little of another
    middle = RNG.normal(size=(2, 2, 5)).astype(np.float32)
    features = pool_classes(middle, labels, frozenset())
    assert features.labels.tolist() == [1, 2]
    mean = middle[:, 0].mean(axis=0)
    np.testing.assert_allclose(features.vectors[1], mean / np.linalg.norm(mean), atol=1e-5)
    np.testing.assert_allclose(features.shares[1] ** 2, 0.25)


def test_class_scores_are_one_for_the_same_picture_and_zero_without_common_classes() -> None:
    vectors = np.eye(3, dtype=np.float32)
    one = ClassFeatures(np.array([1, 2], np.uint8), vectors[:2], np.array([0.7, 0.5]))
    other = ClassFeatures(np.array([3], np.uint8), vectors[2:], np.array([0.9]))
    none = ClassFeatures(np.empty(0, np.uint8), np.empty((0, 3), np.float32), np.empty(0))
    index = ClassIndex(3)
    for features in (one, other, none):
        index.add(features)
    np.testing.assert_allclose(index.scores(one), [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(index.scores(none), 0)


def test_a_class_is_compared_by_how_it_differs_from_its_usual_look() -> None:
    usual = np.array([[0, 0, 1], [3, 0, 0]], np.float32)
    vectors = np.array([[3, 1, 0]], np.float32)
    features = ClassFeatures(np.array([1], np.uint8), vectors, np.array([1.0])).against(usual)
    np.testing.assert_allclose(features.vectors, [[0, 1, 0]], atol=1e-6)
    empty = ClassFeatures(np.empty(0, np.uint8), np.empty((0, 3), np.float32), np.empty(0))
    assert len(empty.against(usual).labels) == 0


def test_the_usual_look_of_a_rare_class_is_mostly_that_of_all() -> None:
    common = ClassFeatures(np.array([1], np.uint8), np.array([[1, 0]], np.float32), np.array([1.0]))
    rare = ClassFeatures(np.array([2], np.uint8), np.array([[0, 1]], np.float32), np.array([1.0]))
    usual = learn_usual([common] * 999 + [rare])
    np.testing.assert_allclose(usual[0], [0.999, 0.001], atol=1e-6)
    assert usual[1, 0] > 0.999
    assert 0.01 < usual[2, 1] < 0.1


def test_vectors_are_compared_without_half_of_what_all_keyframes_have_in_common() -> None:
    descriptors = RNG.normal(size=(COMMON_AFTER, 6)).astype(np.float32) + 2
    index = WholeIndex(6)
    for descriptor in descriptors:
        index.add(descriptor)
    freed = descriptors - descriptors.mean(axis=0) / 4
    freed /= np.linalg.norm(freed, axis=1, keepdims=True)
    np.testing.assert_allclose(index.scores(descriptors[3]), freed @ freed[3], atol=1e-5)


def test_a_lone_keyframe_is_compared_nearly_as_it_is() -> None:
    index = WholeIndex(3)
    index.add(np.array([2, 0, 0], np.float32))
    np.testing.assert_allclose(index.scores(np.array([0, 3, 0], np.float32)), [0], atol=0.02)
    np.testing.assert_allclose(index.scores(np.array([4, 0, 0], np.float32)), [1], atol=1e-5)


def test_the_join_trusts_what_tells_look_alikes_apart() -> None:
    count = 240
    photo = np.repeat(np.arange(count // 2), 2)
    kind = np.repeat(RNG.integers(0, 6, count // 2), 2)
    described = DescribedViews(
        photo,
        (np.eye(6)[kind] + RNG.normal(0, 0.05, (count, 6))).astype(np.float32),
        [(np.array([at]), np.ones(1, np.float32)) for at in photo],
        [ClassFeatures(np.array([1], np.uint8), np.eye(6, dtype=np.float32)[[at]], np.ones(1)) for at in kind],
    )
    model = train_fusion(described, np.arange(count).reshape(-1, 2), seed=0)
    same, alike = model.probability(np.array([[1.0, 1.0, 1.0], [1.0, 0.0, 1.0]]))
    assert same > 0.9
    assert alike < 0.5


bags = st.dictionaries(st.integers(0, 30), st.floats(0.1, 1), min_size=1, max_size=8)


@given(bags, bags)
@settings(max_examples=50)
def test_word_score_is_one_minus_half_the_l1_distance(a: dict[int, float], b: dict[int, float]) -> None:
    dense = np.zeros((2, 31), np.float32)
    for row, bag in zip(dense, (a, b), strict=True):
        row[list(bag)] = np.array(list(bag.values())) / sum(bag.values())
    index = WordIndex()
    index.add((np.flatnonzero(dense[0]), dense[0][dense[0] > 0]))
    score = index.scores((np.flatnonzero(dense[1]), dense[1][dense[1] > 0]))
    assert score[0] == pytest.approx(1 - np.abs(dense[0] - dense[1]).sum() / 2, abs=1e-5)


def test_the_index_scores_the_same_in_whatever_pieces_it_lies() -> None:
    dense = (RNG.random((3 * RECENT + 7, 40)) * (RNG.random((3 * RECENT + 7, 40)) < 0.3)).astype(np.float32)
    dense[5] = 0
    index = WordIndex()
    for row in dense:
        index.add((np.flatnonzero(row), row[row > 0]))
    for row in dense[[0, 5, 300]]:
        found = index.scores((np.flatnonzero(row), row[row > 0]))
        np.testing.assert_allclose(found, np.minimum(dense, row).sum(axis=1), atol=1e-5)


def test_grouping_averages_over_a_window_of_time() -> None:
    stamps = np.array([0.0, 0.3, 0.6, 5.0])
    np.testing.assert_allclose(grouped(np.array([0.3, 0.6, 0.0, 0.9]), stamps, 0.35), [0.45, 0.3, 0.3, 0.9])


def test_the_projection_drops_what_changes_within_a_place() -> None:
    places = RNG.normal(size=(100, 8))
    light = RNG.normal(size=(200, 1)) * 5
    pooled = np.repeat(places, 2, axis=0)
    pooled = np.column_stack([pooled, light]).astype(np.float32)
    same = np.arange(200).reshape(-1, 2)
    strange = np.column_stack([np.arange(0, 190), np.arange(10, 200)])
    pairs = np.concatenate([same, strange])
    _, projection = learn_projection(pooled, pairs, np.arange(len(pairs)) < len(same))
    gain = np.linalg.norm(projection, axis=1)
    assert gain[8] < 0.5 * gain[:8].min()


def test_probability_rises_with_every_part_of_the_shipped_model() -> None:
    model = load_fusion()
    assert (model.weights > 0).all()
    low, high = model.probability(np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]))
    assert low < 0.01
    assert high > 0.99


def test_a_missing_or_damaged_model_is_one_sentence(tmp_path) -> None:
    with pytest.raises(ModelError, match="fusion model"):
        load_fusion(tmp_path / "none.npz")
    (tmp_path / "bad.npz").write_bytes(b"PK\x03\x04 not really")
    with pytest.raises(ModelError, match="damaged"):
        load_fusion(tmp_path / "bad.npz")


def test_a_saved_model_comes_back(tmp_path) -> None:
    usual = np.arange(82, dtype=np.float32).reshape(41, 2)
    weights = np.array([1.0, 2.0, 3.0])
    model = FusionModel(np.ones(832, np.float32), np.ones((832, 4), np.float32), usual, weights, -1.0)
    model.save(tmp_path / "m.npz")
    again = load_fusion(tmp_path / "m.npz")
    np.testing.assert_array_equal(again.projection, model.projection)
    np.testing.assert_array_equal(again.usual_features(["wall", "a new thing"]), usual[[1, 0]])
    assert (again.bias, again.weights.tolist()) == (-1.0, [1, 2, 3])


def test_views_of_a_photo_overlap_and_repeat_for_a_seed() -> None:
    photo = RNG.integers(0, 256, (120, 160, 3), dtype=np.uint8)
    first, second = (make_view(photo, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first.color, second.color)
    assert overlap(first, second) == 1
    assert 0 <= overlap(first, make_view(photo, np.random.default_rng(4))) <= 1


def test_relighting_does_what_it_says() -> None:
    photo = RNG.integers(20, 236, (40, 60, 3), dtype=np.uint8)
    assert gamma(photo, 2.5).mean() < photo.mean() < gamma(photo, 0.4).mean()
    assert tint(photo, (1.2, 1.0, 0.8))[..., 0].mean() > photo[..., 0].mean()
    dark = shadow(photo, 0.0, 0.0, 0.6)
    assert dark[:, -5:].mean() < 0.6 * photo[:, -5:].mean()
    assert abs(float(noise(photo, 20, np.random.default_rng(0)).std()) - float(photo.std())) < 15
    assert relight(photo, np.random.default_rng(1)).shape == photo.shape


@given(st.floats(-170, 170), st.floats(-50, 50), st.floats(-180, 180))
@settings(max_examples=60)
def test_roll_is_found_whatever_the_pan_and_tilt(roll: float, tilt: float, pan: float) -> None:
    """Angles in degrees; y points down."""
    axes = [
        exp_so3(np.radians(angle) * axis) for angle, axis in zip((pan, tilt, roll), np.eye(3)[[1, 0, 2]], strict=True)
    ]
    pose = make_transform(axes[0] @ axes[1] @ axes[2], [1, 2, 3])
    assert (roll_of(pose) - roll + 180) % 360 - 180 == pytest.approx(0, abs=1e-6)


def test_looking_down_has_no_roll() -> None:
    assert roll_of(make_transform(exp_so3([np.radians(80), 0, 0]), [0, 0, 0])) == 0


def test_a_rolled_camera_is_turned_upright() -> None:
    upright = cv2.GaussianBlur(RNG.integers(0, 256, (121, 161, 3), dtype=np.uint8), (0, 0), 4)
    pose = make_transform(exp_so3([0, 0, np.radians(30)]), [0, 0, 0])
    rolled = cv2.warpAffine(upright, cv2.getRotationMatrix2D((80, 60), 30, 1.0), (161, 121))
    again = turn_image(rolled, roll_of(pose))
    middle = np.s_[40:80, 60:100]
    assert np.abs(again[middle].astype(int) - upright[middle]).mean() < 2
    labels = turn_labels(np.ones((121, 161), np.uint8), 30.0)
    assert labels[60, 80] == 1
    assert labels[0, 0] == 0
    assert turn_image(upright, 1.0) is upright
