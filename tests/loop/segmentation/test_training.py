"""Training on a tiny made-up folder: it learns, survives a kill, and scores are right."""

import cv2
import numpy as np
import pytest
import torch

from semslam.config import load_config
from semslam.errors import ConfigError, DatasetError, ModelError
from semslam.loop.detectors.common.backbone import Backbone
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.segmentation.network.averaging import average
from semslam.loop.segmentation.network.checkpoint import load_network, read_tensors, save_weights
from semslam.loop.segmentation.network.network import build_mobilenet_deeplab
from semslam.loop.segmentation.photos import Photo, read_photo
from semslam.loop.segmentation.segmenters.onnx import load_graph
from semslam.loop.segmentation.shipped import CHECKPOINT
from semslam.loop.segmentation.training.evaluation import confusion_matrix, evaluate, score
from semslam.loop.segmentation.training.example import GREY
from semslam.loop.segmentation.training.examples import class_weights, photos_by_class
from semslam.loop.segmentation.training.optimisation import learning_rate, soft_cross_entropy
from semslam.loop.segmentation.training.self_training import Teacher, teach
from semslam.loop.segmentation.training.training import train
from semslam.loop.segmentation.training.training_log import read_log

SIZE = {"width": 64, "height": 48}


def settings(seed=0, **training):
    values = {"epochs": 2, "batch": 2, "save_every": 1e-9, "average": 0.5, **training}
    return load_config(overrides={"seed": seed, "training": values, "segmentation": SIZE})


class KilledError(Exception):
    pass


def kill_at_third(progress):
    if progress.step == 3:
        raise KilledError


def test_resumed_training_ends_with_the_same_weights(rooms, tmp_path):
    whole = read_tensors(train(rooms, settings(), tmp_path / "whole"))

    with pytest.raises(KilledError):
        train(rooms, settings(), tmp_path / "torn", kill_at_third)
    steps = []
    torn = read_tensors(train(rooms, settings(), tmp_path / "torn", lambda p: steps.append(p.step)))
    assert steps == [3, 4]
    assert all(torch.equal(whole[name], torn[name]) for name in whole)


def test_training_learns_and_its_outputs_serve(rooms, tmp_path):
    losses = []
    out = tmp_path / "run"
    weights = train(
        rooms, settings(epochs=20, start=str(CHECKPOINT), freeze_norms=True), out, lambda p: losses.append(p.loss)
    )
    assert np.mean(losses[-4:]) < 0.7 * np.mean(losses[:4])
    assert [row[0] for row in read_log(out / "training.csv")] == [20, 40]
    assert (out / "training.png").stat().st_size > 1000
    for path in (weights, out / "weights.onnx"):
        config = load_config(overrides={"segmentation": {**SIZE, "weights": str(path)}})
        result = evaluate(build_segmenter(config), rooms, size=None)
        assert result.pixel_accuracy > 0.8
        assert result.per_class_iou["chair"] is None


@pytest.fixture
def deep_rooms(rooms):
    """The same rooms with depth: the wall stands still, the floor comes nearer."""
    (rooms / "depth").mkdir()
    for i in range(6):
        labels = cv2.imread(str(rooms / "labels40" / f"{i}.png"), cv2.IMREAD_UNCHANGED)
        below = np.cumsum(labels == 2, axis=0)
        depth = (250 / (1 + below / 30)).astype(np.uint8)
        cv2.imwrite(str(rooms / "depth" / f"{i}.png"), cv2.resize(depth, (64, 48), interpolation=cv2.INTER_NEAREST))
    return rooms


def test_a_network_that_sees_depth_learns_from_it_and_serves_without(deep_rooms, tmp_path):
    chosen = {"depth": True, "start": str(CHECKPOINT), "freeze_norms": True, "encoder_rate": 0, "rate": 3e-3}
    weights = train(deep_rooms, settings(epochs=20, **chosen, known_rate=0.5), tmp_path / "run")
    trained, before = read_tensors(weights), read_tensors(CHECKPOINT)
    assert all(torch.equal(trained[name], before[name]) for name in before if name.startswith("encoder."))
    for path in (weights, weights.with_name("weights.onnx")):
        config = load_config(overrides={"segmentation": {**SIZE, "weights": str(path)}})
        segmenter = build_segmenter(config)
        for depth in (True, False):
            assert evaluate(segmenter, deep_rooms, size=None, with_depth=depth).pixel_accuracy > 0.75
        grey = np.full((96, 128, 3), GREY, np.uint8)
        depth = read_photo(deep_rooms, "0").depth
        assert not np.array_equal(segmenter.segment(grey, depth).labels, segmenter.segment(grey).labels)
    with pytest.raises(ConfigError, match="sees depth"):
        train(deep_rooms, settings(start=str(weights)), tmp_path / "blind")
    with pytest.raises(ModelError, match="cannot be narrowed"):
        train(deep_rooms, settings(start=str(weights), depth=True, decoder_channels=32), tmp_path / "narrow")


def test_resumed_training_with_depth_ends_with_the_same_weights(deep_rooms, tmp_path):
    with pytest.raises(KilledError):
        train(deep_rooms, settings(depth=True), tmp_path / "torn", kill_at_third)
    torn, whole = (read_tensors(train(deep_rooms, settings(depth=True), tmp_path / name)) for name in ("torn", "whole"))
    assert all(torch.equal(whole[name], torn[name]) for name in whole)


def test_training_with_depth_needs_depth(rooms, tmp_path):
    with pytest.raises(DatasetError, match="no depth"):
        train(rooms, settings(depth=True), tmp_path / "run")


def test_a_network_on_xception_is_trained_and_serves(deep_rooms, tmp_path):
    with pytest.raises(KilledError):  # before its export to int8, which takes half a minute
        train(deep_rooms, settings(backbone="xception65"), tmp_path, kill_at_third)
    weights = tmp_path / "weights.pt"
    config = load_config(overrides={"segmentation": {**SIZE, "weights": str(weights)}})
    assert build_segmenter(config).segment(read_photo(deep_rooms, "4").color).labels.shape == (96, 128)
    with pytest.raises(ModelError, match="not the MobileNetV2"):
        Backbone.from_config(config)
    with pytest.raises(ConfigError, match="another encoder"):
        train(deep_rooms, settings(start=str(weights)), tmp_path / "next")
    with pytest.raises(ConfigError, match="can see depth"):
        train(deep_rooms, settings(backbone="xception65", depth=True), tmp_path / "next")


def test_a_network_that_begins_at_random_sees_depth_where_asked(deep_rooms, tmp_path):
    weights = train(deep_rooms, settings(epochs=1, depth=True), tmp_path)
    assert load_network(weights).depth is not None


def test_damaged_state_is_one_sentence(rooms, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "state.pt").write_bytes(b"torn")
    with pytest.raises(ModelError, match="state"):
        train(rooms, settings(), tmp_path / "run")


def test_other_settings_do_not_resume(rooms, tmp_path):
    with pytest.raises(KilledError):
        train(rooms, settings(), tmp_path / "run", kill_at_third)
    with pytest.raises(ModelError, match="other settings"):
        train(rooms, settings(epochs=3), tmp_path / "run")


def test_teacher_tells_what_it_believes(rooms, tmp_path):
    teacher = Teacher([load_graph(None, "int8")], sizes=((64, 48), (96, 64)))
    probabilities = teacher.probabilities(read_photo(rooms, "0").color)
    assert probabilities.shape == (16, 24, 40)
    np.testing.assert_allclose(probabilities.sum(axis=2), 1.0, atol=1e-5)
    photo = teach(teacher, rooms, rooms / "rgb", tmp_path / "taught")[0]
    assert photo.beliefs.shape == (1 + 16 * 24, 40)
    assert not photo.beliefs[0].any()
    under_first_column = photo.beliefs[photo.cells[3::6, 2]] / 255.0
    np.testing.assert_allclose(under_first_column, probabilities[:, 0], atol=0.01)


def test_training_asks_teachers_once(rooms, tmp_path):
    taught = settings(epochs=1, unlabelled=str(rooms / "rgb"), teachers=[str(CHECKPOINT)], unlabelled_share=0.9)
    assert train(rooms, taught, tmp_path / "run").exists()
    kept = sorted((tmp_path / "run" / "taught").iterdir())
    assert [path.name for path in kept] == [f"{i}.npy" for i in range(6)]
    with pytest.raises(ConfigError, match="needs both"):
        train(rooms, settings(unlabelled=str(rooms / "rgb")), tmp_path / "other")


def test_soft_cross_entropy_of_labels_is_the_weighted_one():
    rng = np.random.default_rng(0)
    logits = torch.from_numpy(rng.normal(size=(2, 40, 3, 4)))
    labels = torch.from_numpy(rng.integers(0, 40, (2, 3, 4)))
    weights = torch.from_numpy(rng.uniform(0.3, 4.0, 40))
    targets = (torch.nn.functional.one_hot(labels, 40) * weights).permute(0, 3, 1, 2)
    expected = torch.nn.functional.cross_entropy(logits, labels, weight=weights)
    torch.testing.assert_close(soft_cross_entropy(logits, targets), expected)
    assert soft_cross_entropy(logits, torch.zeros_like(targets)) == 0


@pytest.mark.parametrize(
    ("damage", "word"),
    [
        (lambda d: (d / "train.txt").unlink(), "no list"),
        (lambda d: (d / "train.txt").write_text(""), "empty"),
        (lambda d: (d / "rgb" / "1.png").unlink(), "cannot be read"),
        (lambda d: (d / "labels40" / "1.png").write_bytes(b"torn"), "damaged or no image"),
        (lambda d: cv2.imwrite(str(d / "labels40" / "1.png"), np.zeros((5, 5), np.uint8)), "another size"),
        (
            lambda d: cv2.imwrite(str(d / "labels40" / "1.png"), np.full((96, 128), 41, np.uint8)),
            "beyond the 41 classes",
        ),
    ],
)
def test_faulty_folder_is_one_sentence(rooms, tmp_path, damage, word):
    damage(rooms)
    with pytest.raises(DatasetError, match=word):
        train(rooms, settings(), tmp_path / "run")


def test_photos_are_found_by_their_classes():
    color = np.zeros((10, 10, 3), np.uint8)
    plain, rare = (Photo(name, color, np.ones((10, 10), np.uint8)) for name in ("plain", "rare"))
    rare.labels[0, 0] = 5
    names = [[photo.name for photo in group] for group in photos_by_class([plain, rare])]
    assert names == [["plain", "rare"], ["rare"]]


def test_rare_classes_weigh_more():
    labels = np.ones((10, 10), np.uint8)
    labels[0, :4] = 5
    labels[1, :9] = 2
    weights = class_weights([Photo("x", np.zeros((10, 10, 3), np.uint8), labels)])
    assert weights.shape == (40,)
    assert weights[4] > weights[0]


def test_learning_rate_climbs_then_falls():
    rates = [learning_rate(step, 100, 0.1) for step in range(100)]
    assert np.argmax(rates) in (9, 10)
    assert rates[0] == pytest.approx(0.1)
    assert rates[-1] < 0.01


def test_the_mean_of_networks_lies_between_them(rooms, tmp_path):
    paths = [train(rooms, settings(), tmp_path / "a"), train(rooms, settings(epochs=1), tmp_path / "b")]
    config = settings()
    mean = read_tensors(average(rooms, [paths[0], paths[1], paths[1]], config, tmp_path / "mean"))
    a, b = map(read_tensors, paths)
    for name, value in mean.items():
        if value.is_floating_point():
            torch.testing.assert_close(value, (a[name] + 2 * b[name]) / 3, rtol=2e-3, atol=1e-4)
    assert load_graph(tmp_path / "mean" / "weights.onnx", "int8")
    with pytest.raises(ModelError, match="no network weights"):
        average(rooms, [paths[0], tmp_path / "absent.pt"], config, tmp_path / "mean")


def test_networks_of_different_widths_have_no_mean(rooms, tmp_path):
    save_weights(build_mobilenet_deeplab(decoder_channels=32), tmp_path / "narrow.pt")
    with pytest.raises(ModelError, match="width"):
        average(rooms, [CHECKPOINT, tmp_path / "narrow.pt"], settings(), tmp_path / "mean")


def test_wider_networks_are_narrowed_before_the_mean(rooms, tmp_path):
    narrow = settings(decoder_channels=32)
    one = average(rooms, [CHECKPOINT], narrow, tmp_path / "one")
    again = average(rooms, [one, CHECKPOINT], narrow, tmp_path / "again")
    first, second = read_tensors(one), read_tensors(again)
    assert first["classifier.weight"].shape == (40, 32, 1, 1)
    assert all(torch.allclose(first[name], second[name], rtol=1e-2, atol=1e-3) for name in first)


def test_trainings_from_one_start_keep_the_same_channels(rooms, tmp_path):
    """Whatever the seed, or their networks would have no mean."""
    first, second = (
        read_tensors(
            train(
                rooms,
                settings(start=str(CHECKPOINT), decoder_channels=32, freeze_norms=True, rate=1e-9, seed=s),
                tmp_path / f"{s}",
            )
        )
        for s in (0, 1)
    )
    assert first["classifier.weight"].shape == (40, 32, 1, 1)
    assert all(torch.allclose(first[name], second[name], atol=1e-3) for name in first if "decoder" in name)


def test_scores_of_a_case_done_by_hand():
    truth = np.array([[1, 1, 1, 2], [2, 2, 0, 0]], np.uint8)
    given = np.array([[1, 1, 2, 2], [2, 3, 1, 1]], np.uint8)
    result = score(confusion_matrix(truth, given))
    assert result.per_class_iou["wall"] == pytest.approx(2 / 3)
    assert result.per_class_iou["floor"] == pytest.approx(2 / 4)
    assert result.per_class_iou["cabinet"] is None
    assert result.miou == pytest.approx((2 / 3 + 2 / 4) / 2)
    assert result.pixel_accuracy == pytest.approx(4 / 6)
    assert result.mean_class_accuracy == pytest.approx(2 / 3)


def test_shipped_network_meets_its_model_card(shared):
    directory = shared / "data" / "nyuv2"
    result = evaluate(build_segmenter(load_config()), directory)
    assert result.miou > 0.37
    assert result.pixel_accuracy > 0.67
