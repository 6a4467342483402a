"""Two layers of the segmentation network's encoder, for detectors that compare places by learned features."""

from dataclasses import dataclass
from typing import Self

import onnx
from onnx.utils import Extractor

from semslam.config import Config
from semslam.errors import ModelError
from semslam.loop.segmentation.decoding import input_size, shrink
from semslam.loop.segmentation.segmenters.onnx import FEATURES, IMAGE, image_rows, load_graph, open_session
from semslam.types import Float32Array, KeyframeView, UInt8Array

MIDDLE_CHANNELS, HIGH_CHANNELS = 96, 320
"""Channels of MobileNetV2's two layers, on whose features the detectors were trained."""
AFTER_ENCODER = "/network/aspp/point/conv/Conv"
"""The node that reads the encoder's last output, which the graph gives no name of its own."""


@dataclass(frozen=True, slots=True, eq=False)
class Encoding:
    """The encoder's features of an image, at a sixteenth of the network's input size.

    Attributes:
        middle: (h, w, MIDDLE_CHANNELS) float32, block 13.
        high: (h, w, HIGH_CHANNELS) float32, block 17, the last.
    """

    middle: Float32Array
    high: Float32Array


class Backbone:
    """Runs the encoder alone: the graph is cut behind what is wanted of it.

    Args:
        graph: the segmentation network.
        size: width and height of the network's input.
        threads: inference threads.
        deep: whether ``encode`` is wanted; without, ``middle`` takes two thirds of the time.

    Attributes:
        size: width and height of the network's input.
    """

    def __init__(self, graph: bytes, size: tuple[int, int], threads: int = 1, deep: bool = True) -> None:
        try:
            model = onnx.load_from_string(graph)
        except Exception as error:  # protobuf's errors are its own
            raise ModelError("The network weights are damaged or not an ONNX graph.") from error
        high = next((node.input[0] for node in model.graph.node if node.name == AFTER_ENCODER), None)
        if high is None or FEATURES not in {out.name for out in model.graph.output}:
            raise ModelError("The ONNX graph is not one that semslam exported.")
        model.graph.output.append(onnx.helper.make_tensor_value_info(high, onnx.TensorProto.FLOAT, None))
        outputs = [FEATURES, high] if deep else [FEATURES]
        part = Extractor(model).extract_model([IMAGE], outputs)
        self._session = open_session(part.SerializeToString(), size, threads, outputs)
        self.size = size
        if [out.shape[1] for out in self._session.get_outputs()] != [MIDDLE_CHANNELS, HIGH_CHANNELS][: len(outputs)]:
            raise ModelError("The network's encoder is not the MobileNetV2 on whose features the detector was trained.")

    @classmethod
    def from_config(cls, config: Config, deep: bool = True, size: tuple[int, int] | None = None) -> Self:
        """Load the network that the segmenter "onnx" would load; ``size`` is the segmentation's where none is given.

        Raises:
            ModelError: the weights are missing, damaged or of another network.
            ConfigError: the input size does not fit the network.
        """
        settings = config.segmentation
        graph = load_graph(settings.weights, settings.precision)
        return cls(graph, size or input_size(settings), settings.threads, deep)

    def encode(self, color: UInt8Array) -> Encoding:
        """Encode an RGB image (H, W, 3) uint8; needs ``deep``."""
        middle, high = self._run(color)
        return Encoding(middle, high)

    def middle(self, view: KeyframeView) -> Float32Array:
        """``Encoding.middle`` of a keyframe's image alone, as its segmentation left it where it did."""
        if view.labels is not None and view.labels.features is not None:
            return view.labels.features
        return self._run(view.color)[0]

    def _run(self, color: UInt8Array) -> list[Float32Array]:
        outputs = self._session.run(None, {IMAGE: shrink(color, self.size)[None]})
        return [image_rows(out) for out in outputs]
