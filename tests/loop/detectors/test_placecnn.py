"""Place networks and their layers."""

import numpy as np
import pytest
import torch

from semslam.config import Config
from semslam.errors import ConfigError, ModelError
from semslam.loop.detectors.global_descriptor.alexnet import build_classifier, build_network
from semslam.loop.detectors.placecnn.alexnet import AlexNetPlaces
from semslam.loop.detectors.placecnn.detector import SHIPPED, PlaceCnnDetector
from semslam.loop.detectors.placecnn.network import EncoderPlaces
from semslam.loop.detectors.placecnn.training import ROOM_TYPES, room_type, train_head
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.testing.scenes import place

SIZES = {"block13": 20 * 15 * 96, "block17": 20 * 15 * 320, "pool": 832, "fc6": 128, "fc7": 64, "fc8": len(ROOM_TYPES)}


def make(**changes: object) -> PlaceCnnDetector:
    return PlaceCnnDetector.from_config(Config().with_changes(placecnn=changes))


@pytest.mark.parametrize("layer", EncoderPlaces.layers)
def test_each_layer_can_be_compared(layer) -> None:
    detector = make(layer=layer)
    vector = detector.describe(place(0, 0))
    assert vector.shape == (SIZES[layer],)
    assert (vector >= 0).all() == (layer in {"pool", "fc6", "fc7"})
    assert detector.features_from == f"{layer} of the shipped encoder, with a head trained on types of rooms"


def test_an_unknown_layer_ends_in_one_sentence() -> None:
    with pytest.raises(ConfigError, match=r"no layer 'conv9'\. Known: best, block13"):
        make(layer="conv9")


def labelled(*names: str) -> np.ndarray:
    image = np.ones((40, 40), np.uint8)
    for number, name in enumerate(names):
        image[4 * number : 4 * number + 4] = NYU40_NAMES.index(name)
    return image


def test_types_of_rooms_follow_from_what_is_in_them() -> None:
    found = [
        ROOM_TYPES[room_type(labelled(*names))][0] for names in (("bed", "desk"), ("desk",), ("table", "sofa"), ())
    ]
    assert found == ["bedroom", "office", "living room", "other"]
    speck = labelled()
    speck[0, 0] = NYU40_NAMES.index("toilet")
    assert ROOM_TYPES[room_type(speck)][0] == "other"


def test_a_head_learns_what_separates_types() -> None:
    rng = np.random.default_rng(0)
    types = rng.integers(0, 3, 200)
    pooled = (np.eye(3)[types].repeat(4, axis=1) + rng.normal(0, 0.3, (200, 12))).astype(np.float32)
    head = train_head(pooled, types.tolist(), seed=0)
    named = np.array([head.outputs(row)["fc8"].argmax() for row in pooled])
    assert (named == types).mean() > 0.95
    again = train_head(pooled, types.tolist(), seed=0)
    np.testing.assert_array_equal(head.weights[0], again.weights[0])


def test_damaged_weights_are_refused(tmp_path) -> None:
    arrays = dict(np.load(SHIPPED))
    np.savez(tmp_path / "p.npz", **{name: array for name, array in arrays.items() if name != "best"})
    with pytest.raises(ModelError, match="no place network"):
        EncoderPlaces.load(None, tmp_path / "p.npz")  # type: ignore[arg-type]


def test_alexnet_of_places_is_read_where_the_user_has_it(tmp_path) -> None:
    torch.manual_seed(0)
    features, classifier = build_network(13), build_classifier(5)
    state = {f"features.module.{name}": value for name, value in features.state_dict().items()}
    state |= {f"classifier.{name}": value for name, value in classifier.state_dict().items()}
    torch.save({"state_dict": state}, tmp_path / "alexnet_places.pth.tar")
    detector = make(weights=str(tmp_path / "alexnet_places.pth.tar"))
    assert detector.features_from == "pool5 of AlexNet with the weights of alexnet_places.pth.tar"
    assert detector.describe(place(0, 0)).shape == (256 * 6 * 6,)
    network = AlexNetPlaces(features, classifier, "test")
    sizes = [len(network.output(place(0, 0).color, layer)) for layer in network.layers]
    assert sizes == [64 * 55**2, 192 * 27**2, 384 * 13**2, 256 * 13**2, 256 * 13**2, 256 * 36, 4096, 4096, 5]
    with pytest.raises(ModelError, match="no weights of a place network"):
        make(weights=str(tmp_path / "none.pth"))
    (tmp_path / "bad.pth").write_bytes(b"no weights")
    with pytest.raises(ModelError, match="does not hold the weights of AlexNet"):
        make(weights=str(tmp_path / "bad.pth"))
