"""The segmentation network's inner view of an image, for detectors that compare places by learned features."""

import hashlib
from typing import Self

import numpy as np
import onnxruntime

from loop.segmentation.decoding import input_size, shrink
from loop.segmentation.onnx import load_graph, open_session
from loop.segmentation.photos import UInt8Array
from semslam.config import Config
from semslam.geometry import Float32Array


class FeatureNetwork:
    """Gives the output of MobileNetV2's thirteenth block, 96 channels at a sixteenth of the input's size.

    Args:
        graph: a graph made by ``loop.segmentation.export``.
        size: width and height of its input.
        threads: inference threads.
    """

    def __init__(self, graph: bytes, size: tuple[int, int], threads: int = 1) -> None:
        self._session = open_session(graph, size, threads)
        self._size = size
        # The decoder is most of the network, and not wanted here.
        self._options = onnxruntime.RunOptions()
        self._options.only_execute_path_to_fetches = True
        self.fingerprint = hashlib.sha256(graph + f"features {size}".encode()).hexdigest()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Load the network that the segmenter "onnx" would load.

        Raises:
            ModelError: the weights are missing, damaged or of another network.
            ConfigError: the input size does not fit the network.
        """
        settings = config.segmentation
        return cls(load_graph(settings.weights, settings.precision), input_size(settings), settings.threads)

    def extract(self, color: UInt8Array) -> Float32Array:
        """Features (height / 16, width / 16, 96) float32 of an RGB image (H, W, 3) uint8."""
        image = shrink(color, self._size)
        features = self._session.run(["features"], {"image": image[None]}, self._options)[0]
        return np.ascontiguousarray(np.asarray(features, dtype=np.float32)[0].transpose(1, 2, 0))
