"""Two layers of the segmentation network's encoder, for detectors that compare places by learned features."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import onnx
import onnxruntime

from semslam.config import Config
from semslam.errors import ModelError
from semslam.loop.segmentation.decoding import input_size, shrink
from semslam.loop.segmentation.segmenters.onnx import load_graph, open_session
from semslam.types import Float32Array, UInt8Array

MIDDLE = "features"
"""The graph's name of the thirteenth block's output."""
AFTER_ENCODER = "/network/aspp/point/conv/Conv"
"""The node that reads the encoder's last output, which the graph gives no name of its own."""


@dataclass(frozen=True, slots=True, eq=False)
class Encoding:
    """The encoder's features of an image, at a sixteenth of the network's input size.

    Attributes:
        middle: (h, w, 96) float32, block 13.
        high: (h, w, 320) float32, block 17, the last.
    """

    middle: Float32Array
    high: Float32Array


class Backbone:
    """Runs the encoder alone; the decoder is most of the network, and not wanted here.

    Attributes:
        size: width and height of the network's input.
    """

    def __init__(self, graph: bytes, size: tuple[int, int], threads: int = 1) -> None:
        try:
            model = onnx.load_from_string(graph)
        except Exception as error:  # protobuf's errors are its own
            raise ModelError("The network weights are damaged or not an ONNX graph.") from error
        self._high = next((node.input[0] for node in model.graph.node if node.name == AFTER_ENCODER), None)
        if self._high is None:
            raise ModelError("The ONNX graph is not one that semslam exported.")
        model.graph.output.append(onnx.helper.make_tensor_value_info(self._high, onnx.TensorProto.FLOAT, None))
        self._session = open_session(model.SerializeToString(), size, threads)
        self.size = size
        self._options = onnxruntime.RunOptions()
        self._options.only_execute_path_to_fetches = True

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Load the network that the segmenter "onnx" would load.

        Raises:
            ModelError: the weights are missing, damaged or of another network.
            ConfigError: the input size does not fit the network.
        """
        settings = config.segmentation
        return cls(load_graph(settings.weights, settings.precision), input_size(settings), settings.threads)

    def encode(self, color: UInt8Array) -> Encoding:
        """Encode an RGB image (H, W, 3) uint8."""
        image = shrink(color, self.size)
        outputs = self._session.run([MIDDLE, self._high], {"image": image[None]}, self._options)
        middle, high = (np.asarray(out, dtype=np.float32)[0].transpose(1, 2, 0) for out in outputs)
        return Encoding(np.ascontiguousarray(middle), np.ascontiguousarray(high))
