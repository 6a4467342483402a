"""What is special to each segmenter; what holds for all of them stands in the contract."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from semslam.config import Config, load_config
from semslam.datasets.selection import Selection
from semslam.errors import ConfigError, DatasetError, ModelError
from semslam.loop.detectors.common.backbone import Backbone
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.loop.segmentation.decoding import decode
from semslam.loop.segmentation.overlay import draw_overlay
from semslam.loop.segmentation.segmenters.folder import FolderSegmenter
from semslam.loop.segmentation.segmenters.onnx import OnnxSegmenter
from semslam.loop.segmentation.shipped import CHECKPOINT
from semslam.testing.scenes import place
from semslam.types import LabelMap


def config_for(name: str, folder, **settings) -> Config:
    return load_config(overrides={"segmentation": {"name": name, "labels_dir": str(folder), **settings}})


@pytest.fixture
def labels_folder(tmp_path):
    folder = tmp_path / "labels"
    folder.mkdir()
    for i in range(3):
        cv2.imwrite(str(folder / f"{i:06d}.png"), np.full((24, 32), i + 1, np.uint8))
    return folder


def some_image(height: int = 120, width: int = 160) -> np.ndarray:
    image = np.random.default_rng(0).integers(0, 255, (height // 8, width // 8, 3), dtype=np.uint8)
    return cv2.resize(image, (width, height), interpolation=cv2.INTER_CUBIC)


@pytest.mark.parametrize("size", [(320, 240), (160, 128)])
def test_torch_and_onnx_give_the_same_labels(size, labels_folder):
    settings = {"width": size[0], "height": size[1], "precision": "float32"}
    onnx = build_segmenter(config_for("onnx", labels_folder, **settings))
    torch = build_segmenter(config_for("torch", labels_folder, **settings))
    image = some_image(240, 320)
    a, b = onnx.segment(image), torch.segment(image)
    assert (a.labels == b.labels).mean() > 0.9995  # the rest are ties to rounding
    assert np.abs(a.confidence - b.confidence).max() < 1e-3


def test_int8_follows_float_on_photos(shared):
    from semslam.loop.segmentation.photos import list_names, read_photo

    directory = shared / "data" / "nyuv2"
    int8 = build_segmenter(load_config())
    exact = build_segmenter(load_config(overrides={"segmentation": {"precision": "float32"}}))
    agreement = []
    for name in list_names(directory, "val.txt")[::25]:
        color = read_photo(directory, name).color
        agreement.append((int8.segment(color).labels == exact.segment(color).labels).mean())
    assert np.mean(agreement) > 0.9


def test_void_only_below_the_confidence_asked_for(labels_folder):
    image = some_image()
    open_minded = build_segmenter(config_for("onnx", labels_folder)).segment(image)
    strict = build_segmenter(config_for("onnx", labels_folder, min_confidence=0.4)).segment(image)
    assert (open_minded.labels > 0).all()
    assert np.array_equal(strict.labels == 0, open_minded.confidence < 0.4)


def test_decode_equals_argmax_of_enlarged_logits_among_labels_that_win_a_cell():
    logits = np.random.default_rng(1).normal(size=(40, 6, 8)).astype(np.float32)
    enlarged = cv2.resize(logits.transpose(1, 2, 0), (32, 24))
    winners = np.unique(logits.argmax(axis=0))
    assert len(winners) < 40
    enlarged[:, :, np.setdiff1d(np.arange(40), winners)] = -np.inf
    answer = decode(logits, (32, 24))
    assert np.array_equal(answer.labels, enlarged.argmax(axis=2) + 1)
    probabilities = np.exp(logits) / np.exp(logits).sum(axis=0)
    np.testing.assert_allclose(answer.confidence, cv2.resize(probabilities.max(axis=0), (32, 24)), rtol=1e-5)


def test_input_size_must_fit_the_stride(labels_folder):
    with pytest.raises(ConfigError, match="multiples of 16"):
        build_segmenter(config_for("onnx", labels_folder, width=330))


@pytest.mark.parametrize("name", ["onnx", "torch"])
@pytest.mark.parametrize("suffix", [".pt", ".onnx"])
def test_bad_weights_are_one_sentence(name, suffix, tmp_path):
    with pytest.raises(ModelError, match="no network weights"):
        build_segmenter(config_for(name, tmp_path, weights=str(tmp_path / f"absent{suffix}")))
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(b"nothing of use")
    with pytest.raises(ModelError, match="damaged"):
        build_segmenter(config_for(name, tmp_path, weights=str(path)))


def test_checkpoint_runs_through_onnx(tmp_path):
    segmenter = build_segmenter(config_for("onnx", tmp_path, weights=str(CHECKPOINT)))
    assert segmenter.segment(some_image()).labels.shape == (120, 160)


def test_folder_by_index(labels_folder):
    segmenter = FolderSegmenter(labels_folder)
    assert (segmenter.segment(some_image(), frame_index=2).labels == 3).all()
    assert segmenter.names == NYU40_NAMES
    with pytest.raises(DatasetError, match="frame 7"):
        segmenter.segment(some_image(), frame_index=7)
    with pytest.raises(DatasetError, match="frame None"):
        segmenter.segment(some_image())


def test_folder_by_stamp_order_with_own_classes(tmp_path):
    (tmp_path / "classes.txt").write_text("void\nrobot\n")
    for i, stamp in enumerate(("1305031102.160407", "1305031102.194330")):
        cv2.imwrite(str(tmp_path / f"{stamp}.png"), np.full((5, 5), i, np.uint8))
    segmenter = FolderSegmenter(tmp_path)
    assert segmenter.names == ("void", "robot")
    assert (segmenter.segment(some_image(), frame_index=1).labels == 1).all()
    cv2.imwrite(str(tmp_path / "1305031102.160407.png"), np.full((5, 5), 2, np.uint8))
    with pytest.raises(DatasetError, match="beyond the 2"):
        segmenter.segment(some_image(), frame_index=0)


def test_folder_faults_are_one_sentence(tmp_path, labels_folder):
    with pytest.raises(DatasetError, match="no label images"):
        FolderSegmenter(tmp_path / "absent")
    with pytest.raises(ConfigError, match="labels_dir"):
        build_segmenter(load_config(overrides={"segmentation": {"name": "folder"}}))
    (labels_folder / "000001.png").write_bytes(b"torn")
    with pytest.raises(DatasetError, match="damaged"):
        FolderSegmenter(labels_folder).segment(some_image(), frame_index=1)


def test_features_are_a_sixteenth():
    backbone = Backbone.from_config(load_config())
    first, again = backbone.encode(some_image()), backbone.encode(some_image())
    assert (first.middle.shape, first.high.shape) == ((15, 20, 96), (15, 20, 320))
    assert first.middle.dtype == np.float32
    assert first.middle.std() > 0
    assert np.array_equal(first.middle, again.middle)


@pytest.mark.parametrize("precision", ["int8", "float32"])
def test_features_that_the_segmentation_leaves_are_those_of_the_encoder_to_the_bit(precision):
    config = load_config(overrides={"segmentation": {"precision": precision}})
    view = place(0, 0)
    labels = OnnxSegmenter.from_config(config).segment(view.color)
    middle = Backbone.from_config(config).encode(view.color).middle
    assert np.array_equal(labels.features, middle)
    shallow = Backbone.from_config(config, deep=False)
    for given in (labels, replace(labels, features=None), None):
        assert np.array_equal(shallow.middle(replace(view, labels=given)), middle)


def test_overlay_has_a_legend_of_what_is_there():
    labels = np.ones((60, 80), np.uint8)
    labels[30:] = 2
    picture = draw_overlay(np.zeros((60, 80, 3), np.uint8), LabelMap(labels, NYU40_NAMES))
    assert picture.shape == (60, 250, 3)
    assert picture.dtype == np.uint8
    assert len(np.unique(picture[:, 86:104].reshape(-1, 3), axis=0)) == 3  # white, wall, floor


def test_folder_labels_belong_to_the_image_whichever_frames_are_read(tmp_path, wall):
    for number in range(len(wall)):
        cv2.imwrite(str(tmp_path / f"{number:04d}.png"), np.full((8, 8), number, np.uint8))
    segmenter = FolderSegmenter(tmp_path)
    frames = Selection(wall, start=1, stride=4)
    shown = [segmenter.segment(frame.color, frame.depth, frame.source_index).labels[0, 0] for frame in frames]
    assert shown == [1, 5, 9]


def test_folder_labels_of_16_bits_do_not_wrap(tmp_path):
    cv2.imwrite(str(tmp_path / "0.png"), np.full((8, 8), 300, np.uint16))
    (tmp_path / "classes.txt").write_text("void\n" + "".join(f"class {i}\n" for i in range(255)))
    with pytest.raises(DatasetError, match="holds the label 300"):
        FolderSegmenter(tmp_path).segment(np.zeros((8, 8, 3), np.uint8), frame_index=0)
    (tmp_path / "classes.txt").write_text("void\n" + "".join(f"class {i}\n" for i in range(400)))
    with pytest.raises(DatasetError, match="401 names; labels go up to 255"):
        FolderSegmenter(tmp_path)
