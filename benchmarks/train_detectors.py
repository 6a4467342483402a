"""Train everything that the detectors ship, from the photos of NYU Depth v2.

    python benchmarks/train_detectors.py NYUV2_DIR --parts vocabulary,autoencoder,words,fusion

NYUV2_DIR holds rgb/*.jpg and unlabelled/*. The files go to loop/weights. "words" and "fusion" depend on the shipped
segmentation network and are to be trained again when it changes; "fusion" depends on the vocabulary, too.
"""

import argparse
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np

from semslam.config import Config
from semslam.features import FeatureExtractor
from semslam.geometry.camera import Intrinsics
from semslam.loop.detectors.bag_of_words import vocabulary
from semslam.loop.detectors.bag_of_words.detector import make_bag
from semslam.loop.detectors.bag_of_words.word_index import Bag
from semslam.loop.detectors.common.backbone import Backbone
from semslam.loop.detectors.fused import fusion
from semslam.loop.detectors.fused.photo_views import make_view, overlap
from semslam.loop.detectors.fused.training import APART, DescribedViews, train_fusion
from semslam.loop.detectors.global_descriptor import cnnw, conv3
from semslam.loop.detectors.sda import autoencoder
from semslam.loop.detectors.sda import detector as sda
from semslam.loop.segmentation.classes import MOVABLE, NYU40_NAMES
from semslam.loop.segmentation.segmenters.onnx import OnnxSegmenter
from semslam.types import Features, Float32Array, Frame, UInt8Array

SIZE = (640, 480)
VIEWS = 4
MIN_OVERLAP = 0.5
SEED = 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--parts", default="vocabulary,autoencoder,words,fusion")
    args = parser.parse_args()
    for part in args.parts.split(","):
        {"vocabulary": vocabulary_from, "autoencoder": autoencoder_from, "words": words_from, "fusion": fusion_from}[
            part
        ](args.folder)


def read_photos(*folders: Path) -> Iterator[UInt8Array]:
    for path in sorted(path for folder in folders for path in folder.iterdir()):
        photo = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)
        yield photo if photo.shape[1] == SIZE[0] else cv2.resize(photo, SIZE, interpolation=cv2.INTER_CUBIC)


def find_features(extractor: FeatureExtractor, photo: UInt8Array) -> Features:
    camera = Intrinsics(*SIZE, 518.0, 518.0, SIZE[0] / 2, SIZE[1] / 2)
    return extractor.extract(Frame(0, 0.0, photo, np.zeros(photo.shape[:2], np.float32), camera))


def vocabulary_from(folder: Path) -> None:
    extractor = FeatureExtractor(Config().keypoints)
    photos = [find_features(extractor, p).descriptors for p in read_photos(folder / "rgb", folder / "unlabelled")]
    vocabulary.train_vocabulary(photos, branching=8, depth=5, seed=SEED).save(vocabulary.SHIPPED)


def autoencoder_from(folder: Path) -> None:
    patches = np.concatenate([sda.cut_patches(photo) for photo in read_photos(folder / "rgb")])
    autoencoder.train_autoencoder(patches, (200, 50), SEED).save(sda.SHIPPED)


def words_from(folder: Path) -> None:
    backbone = Backbone.from_config(Config())
    rng = np.random.default_rng(SEED)
    maps = [backbone.encode(make_view(photo, rng).color).high for photo in read_photos(folder / "rgb")]
    words = cnnw.train_channel_words(maps, 128, SEED).astype(np.float16)
    histograms = np.array([cnnw.count_words(features, words.astype(np.float32)) for features in maps])
    np.savez_compressed(cnnw.SHIPPED, words=words, min_score=rare_cosine(histograms))
    np.savez_compressed(conv3.SHIPPED, min_score=rare_cosine(np.array(maps).reshape(len(maps), -1)))


def rare_cosine(descriptors: Float32Array) -> float:
    """The cosine that one in a hundred pairs of photos of different places reaches."""
    unit = descriptors / np.linalg.norm(descriptors, axis=1, keepdims=True)
    first, second = np.triu_indices(len(unit), APART + 1)
    return float(np.quantile((unit @ unit.T)[first, second], 0.99))


def fusion_from(folder: Path) -> None:
    config = Config()
    backbone, segmenter = Backbone.from_config(config), OnnxSegmenter.from_config(config)
    extractor, tree = FeatureExtractor(config.keypoints), vocabulary.load_vocabulary()
    movable = frozenset(i for i, name in enumerate(NYU40_NAMES) if name in MOVABLE)
    photo_of, pooled, classes, same = [], [], [], []
    bags: list[Bag] = []
    rng = np.random.default_rng(SEED)
    for number, photo in enumerate(read_photos(folder / "rgb")):
        views = [make_view(photo, rng) for _ in range(VIEWS)]
        start = len(photo_of)
        same += [
            (start + i, start + j)
            for i, j in combinations(range(VIEWS), 2)
            if overlap(views[i], views[j]) >= MIN_OVERLAP
        ]
        for view in views:
            encoding = backbone.encode(view.color)
            photo_of.append(number)
            pooled.append(fusion.pool_layers(encoding))
            bags.append(make_bag(tree, find_features(extractor, view.color).descriptors))
            classes.append(fusion.pool_classes(encoding.middle, segmenter.segment(view.color).labels, movable))
    described = DescribedViews(np.array(photo_of), np.array(pooled), bags, classes)
    model = train_fusion(described, np.array(same), SEED)
    print(f"{len(same)} pairs of views of one place; weights {model.weights.round(2)}, bias {model.bias:.2f}")
    model.save(fusion.SHIPPED)


if __name__ == "__main__":
    main()
