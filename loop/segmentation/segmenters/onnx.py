"""The shipped network through ONNX Runtime: the default segmenter."""

import hashlib
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt
import onnxruntime

from semslam.config import Config
from semslam.errors import ModelError
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.loop.segmentation.decoding import decode, input_size, shrink
from semslam.loop.segmentation.depth_picture import depth_picture, picture_size
from semslam.loop.segmentation.photos import UInt8Array
from semslam.loop.segmentation.shipped import CHECKPOINT, INT8_GRAPH
from semslam.types import Float32Array, LabelMap

IMAGE, DEPTH, LOGITS, FEATURES = "image", "depth", "logits", "features"
"""Names of the graph's inputs, of which a network that sees colour alone has the first, and of its outputs."""


class OnnxSegmenter:
    """Runs an ONNX graph made by ``semslam.loop.segmentation.network.export``, one image at a time.

    Args:
        graph: the serialised graph.
        size: width and height of its input.
        threads: inference threads; they do not spin while they wait, since other stages need the cores.
        min_confidence: below it a pixel becomes void.
    """

    name = "onnx"

    def __init__(self, graph: bytes, size: tuple[int, int], threads: int = 1, min_confidence: float = 0.0) -> None:
        self._session = open_session(graph, size, threads)
        self._size, self._min_confidence = size, min_confidence
        settings = f"{size} {min_confidence}".encode()
        self.fingerprint = hashlib.sha256(graph + settings).hexdigest()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Load the shipped int8 graph, or the weights that ``segmentation.weights`` names.

        Raises:
            ModelError: the weights are missing, damaged or of another network.
            ConfigError: the input size does not fit the network.
        """
        settings = config.segmentation
        graph = load_graph(settings.weights, settings.precision)
        return cls(graph, input_size(settings), settings.threads, settings.min_confidence)

    @property
    def names(self) -> tuple[str, ...]:
        """The 40 NYUv2 classes after void."""
        return NYU40_NAMES

    def segment(self, color: UInt8Array, depth: Float32Array | None = None, frame_index: int | None = None) -> LabelMap:
        """Label an RGB image (H, W, 3) uint8; ``depth`` is used where the network sees depth."""
        pictures = network_input(self._session, color, depth, self._size)
        logits, features = self._session.run([LOGITS, FEATURES], pictures)
        labels = decode(np.asarray(logits)[0], (color.shape[1], color.shape[0]), self._min_confidence)
        return replace(labels, features=image_rows(features))


def image_rows(output: npt.ArrayLike) -> Float32Array:
    """Channels last (h, w, C) of the network's features (1, C, h, w) of one image."""
    return np.ascontiguousarray(np.asarray(output, dtype=np.float32)[0].transpose(1, 2, 0))


def load_graph(weights: Path | None, precision: str) -> bytes:
    """The graph of an ``.onnx`` file, or of a checkpoint that is exported here in float32.

    Raises:
        ModelError: the file is missing, damaged or of another network.
    """
    path = weights or (INT8_GRAPH if precision == "int8" else CHECKPOINT)
    if path.suffix != ".onnx":
        from semslam.loop.segmentation.network.checkpoint import load_network
        from semslam.loop.segmentation.network.export import float_graph

        return float_graph(load_network(path))
    try:
        return path.read_bytes()
    except OSError as error:
        raise ModelError(f"There are no network weights at {path}.") from error


def network_input(
    session: onnxruntime.InferenceSession, color: UInt8Array, depth: Float32Array | None, size: tuple[int, int]
) -> dict[str, UInt8Array]:
    """What a network takes of an image (H, W, 3) with its depth (H, W), which may be missing, by the inputs' names."""
    pictures = {IMAGE: shrink(color, size)[None]}
    if DEPTH in {given.name for given in session.get_inputs()}:
        pictures[DEPTH] = depth_picture(depth, picture_size(size))[None]
    return pictures


def open_session(
    graph: bytes, size: tuple[int, int], threads: int, needed: Collection[str] = (LOGITS, FEATURES)
) -> onnxruntime.InferenceSession:
    """Open a graph for inputs of one size.

    Args:
        graph: the serialised graph.
        size: width and height of its input.
        threads: inference threads.
        needed: outputs that it has to have.

    Raises:
        ModelError: the graph is damaged or of another network.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    half = picture_size(size)
    for name, length in zip(("width", "height", "width_2", "height_2"), (*size, *half), strict=True):
        options.add_free_dimension_override_by_name(name, length)
    try:
        session = onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # the runtime's errors have no common base of their own
        raise ModelError("The network weights are damaged or not an ONNX graph.") from error
    outputs = {out.name for out in session.get_outputs()}
    if [i.name for i in session.get_inputs()] not in ([IMAGE], [IMAGE, DEPTH]) or not set(needed) <= outputs:
        raise ModelError("The ONNX graph is not one that semslam exported.")
    return session
