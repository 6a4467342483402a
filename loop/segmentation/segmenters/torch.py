"""The same network through PyTorch: slower, for comparison and for machines without a fast ONNX Runtime."""

import hashlib
from pathlib import Path
from typing import Self

from semslam.config import Config
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.loop.segmentation.decoding import decode, input_size, shrink
from semslam.loop.segmentation.depth_picture import depth_picture, picture_size
from semslam.loop.segmentation.photos import UInt8Array
from semslam.loop.segmentation.shipped import CHECKPOINT
from semslam.types import Float32Array, LabelMap


class TorchSegmenter:
    """Runs a checkpoint in float32 with PyTorch.

    Args:
        weights: the checkpoint.
        size: width and height of the network's input.
        threads: PyTorch's threads; they are one setting for the whole process.
        min_confidence: below it a pixel becomes void.

    Raises:
        ModelError: the weights are missing, damaged or of another network.
    """

    name = "torch"

    def __init__(self, weights: Path, size: tuple[int, int], threads: int = 1, min_confidence: float = 0.0) -> None:
        import torch

        from semslam.loop.segmentation.network.checkpoint import load_network

        self._network = load_network(weights)
        self._network.eval()
        torch.set_num_threads(threads)
        self._size, self._min_confidence = size, min_confidence
        settings = f"torch {size} {min_confidence}".encode()
        self.fingerprint = hashlib.sha256(weights.read_bytes() + settings).hexdigest()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Load the shipped checkpoint, or the one that ``segmentation.weights`` names."""
        settings = config.segmentation
        return cls(settings.weights or CHECKPOINT, input_size(settings), settings.threads, settings.min_confidence)

    @property
    def names(self) -> tuple[str, ...]:
        """The 40 NYUv2 classes after void."""
        return NYU40_NAMES

    def segment(self, color: UInt8Array, depth: Float32Array | None = None, frame_index: int | None = None) -> LabelMap:
        """Label an RGB image (H, W, 3) uint8; ``depth`` is used where the network sees depth."""
        import torch

        from semslam.loop.segmentation.network.network import to_input

        with torch.inference_mode():
            pictures = [to_input([shrink(color, self._size)])]
            if self._network.depth is not None:
                pictures.append(to_input([depth_picture(depth, picture_size(self._size))]))
            logits, _ = self._network(*pictures)
        return decode(logits[0].numpy(), (color.shape[1], color.shape[0]), self._min_confidence)
