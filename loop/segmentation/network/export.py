"""The network as ONNX: float from a checkpoint, and quantised to int8.

The graph takes an ``image`` (1, height, width, 3) uint8 RGB of any size in multiples of 16 and, where the network sees
depth, the picture of its ``depth`` (1, height / 2, width / 2, 3) uint8. It gives ``logits`` (1, 40, height / 4,
width / 4) and ``features`` (1, C, height / 16, width / 16).
"""

import io
import tempfile
import warnings
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import onnx
import torch
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantFormat, QuantType, quantize_static
from onnxruntime.quantization.shape_inference import quant_pre_process
from torch import Tensor, nn

from semslam.loop.segmentation.decoding import shrink
from semslam.loop.segmentation.depth_picture import depth_picture, picture_size
from semslam.loop.segmentation.network.network import DeepLab
from semslam.loop.segmentation.photos import Photo, UInt8Array
from semslam.loop.segmentation.segmenters.onnx import DEPTH, FEATURES, IMAGE, LOGITS

OPSET = 17
CALIBRATION_STRIDE = 6
WITHOUT_DEPTH = 4
FLOAT_LAYERS = ("stem/conv", "blocks.0/depthwise/conv")
"""Convolutions that int8 would hurt most, each stem and its first filter, whose few channels differ much in range."""


class _FromPixels(nn.Module):
    """The network behind the scaling of pixels, so that no caller can get it wrong."""

    def __init__(self, network: DeepLab) -> None:
        super().__init__()
        self.network = network

    def forward(self, *pictures: Tensor) -> tuple[Tensor, Tensor]:
        out: tuple[Tensor, Tensor] = self.network(*(p.permute(0, 3, 1, 2).float() / 127.5 - 1.0 for p in pictures))
        return out


def float_graph(network: DeepLab) -> bytes:
    """The network as a float32 graph."""
    # The sizes it is traced with; any others will do.
    pixels, names = [torch.zeros((1, 240, 320, 3), dtype=torch.uint8)], [IMAGE]
    if network.depth is not None:
        pixels.append(torch.zeros((1, 120, 160, 3), dtype=torch.uint8))
        names.append(DEPTH)
    buffer: Any = io.BytesIO()  # the signature knows paths alone
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the newer exporter needs a package more, and gives the same graph
        torch.onnx.export(
            _FromPixels(network).eval(), tuple(pixels), buffer, dynamo=False, opset_version=OPSET,
            input_names=names, output_names=[LOGITS, FEATURES],
            dynamic_axes={
                IMAGE: {1: "height", 2: "width"},
                **{name: {1: "height_2", 2: "width_2"} for name in names[1:]},
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
    """Quantise a network to int8: weights per channel, activations calibrated on photos.

    Args:
        network: the trained network.
        path: where the int8 graph goes.
        photos: of the training part; every sixth is taken, and of these every fourth without its depth.
        size: width and height of the network's input in use.
    """
    write_int8(network, path, _inputs(network, photos[::CALIBRATION_STRIDE], size))


def _inputs(network: DeepLab, photos: Sequence[Photo], size: tuple[int, int]) -> Iterator[dict[str, UInt8Array]]:
    for number, photo in enumerate(photos):
        image = {IMAGE: shrink(photo.color, size)[None]}
        depth = None if number % WITHOUT_DEPTH == 0 else photo.depth
        picture = {} if network.depth is None else {DEPTH: depth_picture(depth, picture_size(size))[None]}
        yield image | picture


class _Inputs(CalibrationDataReader):  # type: ignore[misc]
    def __init__(self, inputs: Iterable[dict[str, UInt8Array]]) -> None:
        self.inputs = iter(inputs)

    def get_next(self) -> dict[str, UInt8Array] | None:
        return next(self.inputs, None)


def write_int8(network: DeepLab, path: Path, inputs: Iterable[dict[str, UInt8Array]]) -> None:
    """Quantise a network statically: weights per channel, activations calibrated on ``inputs`` of the graph."""
    with tempfile.TemporaryDirectory() as folder:
        exported = Path(folder) / "float.onnx"
        exported.write_bytes(float_graph(network))
        prepared = Path(folder) / "prepared.onnx"
        quant_pre_process(str(exported), str(prepared), skip_symbolic_shape=True)
        names = [node.name for node in onnx.load(prepared).graph.node if node.op_type == "Conv"]
        kept = [name for name in names if any(f"/{layer}/" in name for layer in FLOAT_LAYERS)]
        quantize_static(
            str(prepared), str(path), _Inputs(inputs), quant_format=QuantFormat.QDQ, per_channel=True,
            nodes_to_exclude=kept,
            activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8, calibrate_method=CalibrationMethod.MinMax,
            extra_options={"CalibMovingAverage": True},
        )  # fmt: skip
