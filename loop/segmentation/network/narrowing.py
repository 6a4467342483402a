"""Prunes the decoder of a trained network: channels that the others can replace are removed.

Channel pruning by reconstruction (He, Zhang and Sun, Channel pruning for accelerating very deep neural networks,
ICCV 2017), with backward elimination: the layer that reads the channels is fitted anew to the rest.
"""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

from semslam.errors import ModelError
from semslam.loop.segmentation.decoding import shrink
from semslam.loop.segmentation.network.checkpoint import network_of
from semslam.loop.segmentation.network.network import DeepLab, to_input
from semslam.loop.segmentation.photos import Photo

VIEWS = 16


class _Fit(NamedTuple):
    """Which inputs a linear layer keeps (count,), its new weights (outputs, count) and offsets (outputs,)."""

    kept: Tensor
    weights: Tensor
    offsets: Tensor


def plain_views(photos: Sequence[Photo], size: tuple[int, int]) -> Tensor:
    """Some photos, whole, as the network's input (B, 3, H, W); networks narrowed on them keep the same channels.

    That holds for networks that were trained from one start and differ little.
    """
    step = -(-len(photos) // VIEWS)
    return to_input([shrink(photo.color, size) for photo in photos[::step]])


@torch.no_grad()
def narrow_decoder(network: DeepLab, channels: int, images: Tensor) -> DeepLab:
    """Return a network whose decoder has ``channels`` in both layers; it needs further training to regain its accuracy.

    Args:
        network: the trained network.
        channels: at most as many as the network's decoder has.
        images: (B, 3, H, W) in -1..1, on which the channels are compared.

    Raises:
        ModelError: the network's decoder is narrower already, or it sees depth.
    """
    if channels > network.decoder_channels:
        raise ModelError(f"The decoder has {network.decoder_channels} channels; it cannot be given {channels}.")
    if channels == network.decoder_channels:
        return network
    if network.depth is not None:
        raise ModelError("A network that sees depth cannot be narrowed; narrow it before the depth branch is added.")
    reader = network.get_submodule("decoder.1.1.conv")
    assert isinstance(reader, nn.Conv2d)
    first = _fit(*_cells_of(network, reader, images), channels)
    second = _fit(*_cells_of(network, network.classifier, images), channels)
    state = network.state_dict()
    _keep(state, ("decoder.0.1.conv", "decoder.0.1.norm", "decoder.1.0.conv", "decoder.1.0.norm"), first.kept)
    state["decoder.1.1.conv.weight"] = first.weights[:, :, None, None]
    state["decoder.1.1.norm.running_mean"] = state["decoder.1.1.norm.running_mean"] - first.offsets
    _keep(state, ("decoder.1.1.conv", "decoder.1.1.norm"), second.kept)
    state["classifier.weight"] = second.weights[:, :, None, None]
    state["classifier.bias"] = second.offsets
    return network_of(state)


def _cells_of(network: DeepLab, layer: nn.Conv2d, images: Tensor) -> tuple[Tensor, Tensor]:
    """What goes into a 1x1 convolution (cells, inputs) and comes out of it (cells, outputs)."""
    seen: list[tuple[Tensor, Tensor]] = []
    handle = layer.register_forward_hook(lambda _layer, inputs, output: seen.append((inputs[0], output)))
    was_training = network.training
    network.eval()(images)
    network.train(was_training)
    handle.remove()
    inputs, outputs = (part.permute(0, 2, 3, 1).flatten(0, 2).double() for part in seen[0])
    return inputs, outputs


def _fit(inputs: Tensor, outputs: Tensor, count: int) -> _Fit:
    """Leave out one input after another, each time the one whose loss the least-squares fit feels least."""
    design = torch.cat([inputs, torch.ones(len(inputs), 1, dtype=inputs.dtype)], 1)
    normal = design.T @ design
    normal += 1e-6 * normal.diagonal().mean() * torch.eye(len(normal), dtype=normal.dtype)
    inverse = torch.linalg.inv(normal)
    weights = inverse @ (design.T @ outputs)
    kept = torch.ones(inputs.shape[1], dtype=torch.bool)
    for _ in range(inputs.shape[1] - count):
        cost = weights[:-1].square().sum(1) / inverse.diagonal()[:-1]
        worst = int(torch.where(kept, cost, torch.inf).argmin())
        column = inverse[:, worst] / inverse[worst, worst]
        weights = weights - torch.outer(column, weights[worst])
        inverse = inverse - torch.outer(column, inverse[worst])
        kept[worst] = False
    return _Fit(kept.nonzero().flatten(), weights[:-1][kept].T.float(), weights[-1].float())


def _keep(state: dict[str, Tensor], layers: tuple[str, ...], kept: Tensor) -> None:
    """Leave only the kept output channels in some layers of a state dict."""
    for name, value in state.items():
        if name.rpartition(".")[0] in layers and value.ndim > 0:
            state[name] = value[kept]
