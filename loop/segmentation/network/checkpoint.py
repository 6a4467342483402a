"""Weights on disk: float16 state dicts."""

import os
from pathlib import Path

import torch
from torch import Tensor, nn

from semslam.errors import ModelError
from semslam.loop.segmentation.network.network import DeepLab, build_mobilenet_deeplab
from semslam.loop.segmentation.network.xception import build_xception_deeplab


def read_tensors(path: Path) -> dict[str, Tensor]:
    """Read a state dict as float32.

    Raises:
        ModelError: the file is missing, damaged or something else.
    """
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except FileNotFoundError as error:
        raise ModelError(f"There are no network weights at {path}.") from error
    except Exception as error:  # torch raises many kinds for a damaged file
        raise ModelError(f"The network weights {path} are damaged or not a PyTorch state dict.") from error
    if not isinstance(state, dict) or not all(isinstance(v, Tensor) for v in state.values()):
        raise ModelError(f"The network weights {path} are not a plain state dict.")
    return {name: v.float() if v.is_floating_point() else v for name, v in state.items()}


def load_network(path: Path) -> DeepLab:
    """The network of a checkpoint.

    Raises:
        ModelError: the file cannot be read or belongs to another network.
    """
    state = read_tensors(path)
    try:
        return network_of(state)
    except (KeyError, IndexError, RuntimeError) as error:
        raise ModelError(f"The weights {path} belong to another network.") from error


def network_of(state: dict[str, Tensor]) -> DeepLab:
    """A network with these weights, and with the encoder, the decoder's width and the depth branch that they are of.

    Raises:
        KeyError, IndexError, RuntimeError: they are of another network.
    """
    width = state["classifier.weight"].shape[1]
    if any(name.startswith("encoder.entry.") for name in state):
        network = build_xception_deeplab(decoder_channels=width)
    else:
        network = build_mobilenet_deeplab(decoder_channels=width, depth="depth.stem.conv.weight" in state)
    network.load_state_dict(state)
    return network


def save_weights(network: nn.Module, path: Path) -> None:
    """Write a network's state as float16, atomically."""
    state = {name: v.half() if v.is_floating_point() else v for name, v in network.state_dict().items()}
    save_atomically(state, path)


def save_atomically(content: object, path: Path) -> None:
    """Write with ``torch.save`` beside the target, then rename: a kill leaves the old file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
    torch.save(content, temporary)
    temporary.replace(path)
