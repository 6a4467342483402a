"""Train everything that the detectors ship, from the photos of NYU Depth v2.

    python benchmarks/train_detectors.py NYUV2_DIR --parts vocabulary,autoencoder,words,fusion

Parts: vocabulary, brief, sift, surf (where OpenCV has it), autoencoder, words, fusion, pcanet, tnnlost, static,
places and submaps, which is learned on rendered houses and not on photos; all but surf where none is named. NYUV2_DIR
holds rgb/*.jpg, unlabelled/*, labels40/*.png, train.txt, val.txt.
The files go to loop/weights. "words", "fusion", "tnnlost", "static", "places" and "submaps" depend on the shipped
segmentation network and are to be trained again when it changes; "fusion" depends on the vocabulary, too.
"""

import argparse
from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
from sklearn.metrics import average_precision_score

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.eval.trajectory import poses_at
from semslam.features import FeatureExtractor
from semslam.geometry.camera import Intrinsics
from semslam.loop.detectors.bag_of_words import vocabulary
from semslam.loop.detectors.bag_of_words.detector import make_bag
from semslam.loop.detectors.bag_of_words.word_index import Bag, WordIndex
from semslam.loop.detectors.bag_of_words.words import LAYOUTS, WordKind, image_describer, shipped_vocabulary
from semslam.loop.detectors.common.backbone import Backbone, Encoding
from semslam.loop.detectors.common.vlad import train_codebook
from semslam.loop.detectors.fused import fusion
from semslam.loop.detectors.fused.photo_views import PhotoView, make_view, overlap
from semslam.loop.detectors.fused.training import APART, DescribedViews, train_fusion
from semslam.loop.detectors.fused_objects import belief
from semslam.loop.detectors.fused_objects.training import is_right, learn_belief
from semslam.loop.detectors.global_descriptor import cnnw, conv3
from semslam.loop.detectors.objects.detector import ObjectsDetector
from semslam.loop.detectors.pcanet import detector as pcanet
from semslam.loop.detectors.pcanet.network import gray_of, train_pcanet
from semslam.loop.detectors.pcanet.settings import PcaNetConfig
from semslam.loop.detectors.placecnn import detector as placecnn
from semslam.loop.detectors.placecnn.network import EncoderPlaces, layer_outputs
from semslam.loop.detectors.placecnn.training import room_type, train_head
from semslam.loop.detectors.sda import autoencoder
from semslam.loop.detectors.sda import detector as sda
from semslam.loop.detectors.static_cnn import detector as static_cnn
from semslam.loop.detectors.static_cnn.settings import StaticCnnConfig
from semslam.loop.detectors.tnnlost import detector as tnnlost
from semslam.loop.detectors.tnnlost.settings import TnnLostConfig
from semslam.loop.segmentation.classes import MOVABLE, NYU40_NAMES
from semslam.loop.segmentation.segmenters.onnx import OnnxSegmenter
from semslam.studies.detectors import keyframe_views
from semslam.types import Features, Float32Array, Frame, LoopCandidate, UInt8Array

SIZE = (640, 480)
VIEWS = 4
MIN_OVERLAP = 0.5
DIMENSIONS, CENTRES = 32, 16
"""Size of the codebook of "tnnlost"."""
SEED = 0
HOUSES = [
    f"synthetic:house?way=back&rate=5&seed={seed}{second}"
    for seed in range(6, 10)
    for second in ("", "&light=evening&moved=1")
]
"""Through the house and back, as things are, and in other light with things moved. What is published of submaps is of
other seeds."""
EVERY = 3
"""Frames from one keyframe to the next there."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--parts", default=",".join(part for part in PARTS if part != "surf"))
    args = parser.parse_args()
    for part in args.parts.split(","):
        PARTS[part](args.folder)


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


def words_vocabulary_from(folder: Path, kind: WordKind) -> None:
    """The vocabulary of words that are not ORB's: bits as large a tree, others one of 4096 words."""
    describe = image_describer(kind)
    photos = [describe(photo) for photo in read_photos(folder / "rgb")]
    tree = vocabulary.train_vocabulary(photos, branching=8, depth=5 if LAYOUTS[kind][1] else 4, seed=SEED)
    tree.save(shipped_vocabulary(kind))
    index = WordIndex()
    bags = [make_bag(tree, photo) for photo in photos]
    for bag in bags:
        index.add(bag)
    scores = np.array([index.scores(bag) for bag in bags])
    print(f"{kind}: proposes from {np.quantile(scores[np.triu_indices(len(bags), APART + 1)], 0.99):.3f} on")


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
    backbone = Backbone.from_config(config, size=fusion.ENCODED_SIZE)
    segmenter = OnnxSegmenter.from_config(config)
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


def pcanet_from(folder: Path) -> None:
    settings = PcaNetConfig()
    grays = [gray_of(photo, (settings.width, settings.height)) for photo in read_photos(folder / "rgb")]
    network = train_pcanet(grays)
    described = np.array([pcanet.describe_image(gray, network, settings) for gray in grays])
    network.save(pcanet.SHIPPED, rare_cosine(described))


def tnnlost_from(folder: Path) -> None:
    config = Config()
    backbone, segmenter = Backbone.from_config(config), OnnxSegmenter.from_config(config)
    rng = np.random.default_rng(SEED)
    views = [make_view(photo, rng).color for photo in read_photos(folder / "rgb")]
    middles = [backbone.encode(view).middle for view in views]
    features = np.concatenate([middle.reshape(-1, middle.shape[2]) for middle in middles])
    codebook = train_codebook(features, DIMENSIONS, CENTRES, SEED)
    labels = [segmenter.segment(view) for view in views]
    described = [
        tnnlost.describe_features(*pair, codebook, TnnLostConfig()) for pair in zip(middles, labels, strict=True)
    ]
    codebook.save(tnnlost.SHIPPED, rare_cosine(np.array(described)))


def static_from(folder: Path) -> None:
    config = Config()
    segmenter = OnnxSegmenter.from_config(config)
    detector = static_cnn.StaticCnnDetector(config.loops, Backbone.from_config(config), 0.0, StaticCnnConfig())
    rng = np.random.default_rng(SEED)
    views = [make_view(photo, rng).color for photo in read_photos(folder / "rgb")]
    described = [detector.describe_image(view, segmenter.segment(view)) for view in views]
    np.savez_compressed(static_cnn.SHIPPED, min_score=rare_cosine(np.array(described)))


def places_from(folder: Path) -> None:
    """The head from photos of train.txt, the best layer from those of val.txt, the scores to propose from from all."""
    backbone, rng = Backbone.from_config(Config()), np.random.default_rng(SEED)
    held = set((folder / "val.txt").read_text().split())
    names = [path.stem for path in sorted((folder / "rgb").iterdir())]
    pooled, first = [], []
    unseen_views: list[PhotoView] = []
    unseen_encodings: list[Encoding] = []
    for name, photo in zip(names, read_photos(folder / "rgb"), strict=True):
        views = [make_view(photo, rng) for _ in range(VIEWS)]
        encodings = [backbone.encode(view.color) for view in views]
        pooled += [fusion.pool_layers(encoding) for encoding in encodings]
        first.append(encodings[0])
        if name in held:
            unseen_views += views
            unseen_encodings += encodings
    labels = [cv2.imread(str(folder / "labels40" / f"{name}.png"), cv2.IMREAD_UNCHANGED) for name in names]
    types = np.repeat([room_type(label) for label in labels], VIEWS)
    unseen = np.repeat([name in held for name in names], VIEWS)
    head = train_head(np.array(pooled)[~unseen], types[~unseen].tolist(), SEED)
    named = np.array([head.outputs(some)["fc8"].argmax() for some in np.array(pooled)[unseen]])
    print(f"types of rooms named correctly in photos of val.txt: {(named == types[unseen]).mean():.3f}")
    precisions, min_scores = {}, {}
    for layer in EncoderPlaces.layers:
        min_scores[layer] = rare_cosine(np.array([layer_outputs(encoding, head)[layer] for encoding in first]))
        outputs = np.array([layer_outputs(encoding, head)[layer] for encoding in unseen_encodings])
        precisions[layer] = view_precision(outputs, unseen_views)
        print(f"{layer}: average precision {precisions[layer]:.3f}, proposes from {min_scores[layer]:.3f} on")
    best = max(precisions, key=precisions.__getitem__)
    EncoderPlaces(backbone, head, best, min_scores).save(placecnn.SHIPPED)


def view_precision(descriptors: Float32Array, views: list[PhotoView]) -> float:
    """Average precision of the cosine over pairs of views: of one photo and overlapping, or of photos far apart."""
    unit = descriptors / np.maximum(np.linalg.norm(descriptors, axis=1, keepdims=True), 1e-9)
    first, second = np.triu_indices(len(unit), 1)
    apart = np.abs(first // VIEWS - second // VIEWS)
    near = [i for i in np.flatnonzero(apart == 0) if overlap(views[first[i]], views[second[i]]) >= MIN_OVERLAP]
    far = np.flatnonzero(apart > APART)
    scores = (unit @ unit.T)[first, second]
    return float(average_precision_score(np.arange(len(near) + len(far)) < len(near), scores[[*near, *far]]))


def submaps_from(_: Path) -> None:
    candidates: list[LoopCandidate] = []
    right: list[bool] = []
    for house in HOUSES:
        dataset = open_dataset(house)
        detector, stamps, found = ObjectsDetector.from_config(Config()), [], []
        for view in keyframe_views(dataset, Config(), EVERY, needs_labels=True):
            found += detector.query(view)
            detector.add(view)
            stamps.append(view.keyframe.timestamp)
        assert dataset.ground_truth is not None
        poses, _ = poses_at(dataset.ground_truth, stamps)
        candidates += found
        right += [is_right(candidate, poses) for candidate in found]
        print(f"{house}: {len(found)} candidates, {sum(right[-len(found) :])} right", flush=True)
    learned = learn_belief(candidates, right)
    learned.save(belief.SHIPPED)
    agree = np.mean((learned.probabilities(candidates) > 0.5) == np.array(right))
    print(f"submaps: {len(candidates)} candidates, {agree:.3f} on the right side of one half: {learned}", flush=True)


PARTS: dict[str, Callable[[Path], None]] = {
    "vocabulary": vocabulary_from,
    "brief": partial(words_vocabulary_from, kind=WordKind.BRIEF),
    "sift": partial(words_vocabulary_from, kind=WordKind.SIFT),
    "surf": partial(words_vocabulary_from, kind=WordKind.SURF),
    "autoencoder": autoencoder_from,
    "words": words_from,
    "fusion": fusion_from,
    "pcanet": pcanet_from,
    "tnnlost": tnnlost_from,
    "static": static_from,
    "places": places_from,
    "submaps": submaps_from,
}

if __name__ == "__main__":
    main()
