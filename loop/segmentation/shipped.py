"""Paths of the weights that come with the package."""

from pathlib import Path

_WEIGHTS = Path(__file__).parent / "weights"
CHECKPOINT = _WEIGHTS / "deeplabv3plus_mobilenetv2_nyu40.pt"
INT8_GRAPH = _WEIGHTS / "deeplabv3plus_mobilenetv2_nyu40_int8.onnx"
