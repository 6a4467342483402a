"""The network as ONNX: float from a checkpoint, and quantised to int8.

The graph takes an image (1, height, width, 3) uint8 RGB of any size in multiples of 16 and gives ``logits``
(1, 40, height / 4, width / 4) and ``features`` (1, C, height / 16, width / 16).
"""

import io
import tempfile
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import onnx
import torch
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantFormat, QuantType, quantize_static
from onnxruntime.quantization.shape_inference import quant_pre_process
from torch import Tensor, nn

from semslam.loop.segmentation.decoding import shrink
from semslam.loop.segmentation.network.network import DeepLab
from semslam.loop.segmentation.photos import Photo, UInt8Array

OPSET = 17
CALIBRATION_STRIDE = 6
FLOAT_LAYERS = 2
"""Convolutions that int8 would hurt most, the stem and its first filter, whose few channels differ much in range."""
INPUT, LOGITS, FEATURES = "image", "logits", "features"


class _FromPixels(nn.Module):
    """The network behind the scaling of pixels, so that no caller can get it wrong."""

    def __init__(self, network: DeepLab) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: Tensor) -> tuple[Tensor, Tensor]:
        out: tuple[Tensor, Tensor] = self.network(image.permute(0, 3, 1, 2).float() / 127.5 - 1.0)
        return out


def float_graph(network: DeepLab) -> bytes:
    """The network as a float32 graph."""
    pixels = torch.zeros((1, 240, 320, 3), dtype=torch.uint8)  # the size it is traced with; any other will do
    buffer: Any = io.BytesIO()  # the signature knows paths alone
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the newer exporter needs a package more, and gives the same graph
        torch.onnx.export(
            _FromPixels(network).eval(), (pixels,), buffer, dynamo=False, opset_version=OPSET,
            input_names=[INPUT], output_names=[LOGITS, FEATURES],
            dynamic_axes={
                INPUT: {1: "height", 2: "width"},
                LOGITS: {2: "height_4", 3: "width_4"},
                FEATURES: {2: "height_16", 3: "width_16"},
            },
        )  # fmt: skip
    graph: bytes = _fold_pads(onnx.load_from_string(buffer.getvalue())).SerializeToString()
    return graph


def _fold_pads(model: onnx.ModelProto) -> onnx.ModelProto:
    """Let the strided convolutions pad by themselves, which their int8 kernels do for nothing."""
    pads = {node.output[0]: node for node in model.graph.node if node.op_type == "Pad"}
    for node in model.graph.node:
        if node.op_type == "Conv" and node.input[0] in pads:
            node.input[0] = pads[node.input[0]].input[0]
            next(a for a in node.attribute if a.name == "pads").ints[:] = [0, 0, 1, 1]
    for pad in pads.values():
        model.graph.node.remove(pad)
    return model


def write_calibrated(network: DeepLab, path: Path, photos: Sequence[Photo], size: tuple[int, int]) -> None:
    """Quantise a network to int8 with every sixth of the photos that it was trained on, at ``size`` (width, height)."""
    write_int8(network, path, (shrink(photo.color, size) for photo in photos[::CALIBRATION_STRIDE]))


class _Photos(CalibrationDataReader):  # type: ignore[misc]
    def __init__(self, images: Iterable[UInt8Array]) -> None:
        self.images = iter(images)

    def get_next(self) -> dict[str, UInt8Array] | None:
        image = next(self.images, None)
        return None if image is None else {INPUT: image[None]}


def write_int8(network: DeepLab, path: Path, images: Iterable[UInt8Array]) -> None:
    """Quantise a network statically: weights per channel, activations calibrated on ``images``.

    Args:
        network: the trained network.
        path: where the int8 graph goes.
        images: (height, width, 3) uint8 RGB photos of the training part, at the size of use.
    """
    with tempfile.TemporaryDirectory() as folder:
        exported = Path(folder) / "float.onnx"
        exported.write_bytes(float_graph(network))
        prepared = Path(folder) / "prepared.onnx"
        quant_pre_process(str(exported), str(prepared), skip_symbolic_shape=True)
        convolutions = [node.name for node in onnx.load(prepared).graph.node if node.op_type == "Conv"]
        quantize_static(
            str(prepared), str(path), _Photos(images), quant_format=QuantFormat.QDQ, per_channel=True,
            nodes_to_exclude=convolutions[:FLOAT_LAYERS],
            activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8, calibrate_method=CalibrationMethod.MinMax,
            extra_options={"CalibMovingAverage": True},
        )  # fmt: skip
