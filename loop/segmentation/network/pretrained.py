"""Starting weights: MLPerf Mobile's DeepLabv3+ MobileNetV2, trained on 31 ADE20K classes, converted for training."""

import re
from pathlib import Path

import torch
from torch import Tensor, nn

from semslam.errors import ModelError
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.loop.segmentation.network.checkpoint import read_tensors
from semslam.loop.segmentation.network.encoder import ConvNorm
from semslam.loop.segmentation.network.network import DeepLab

ADE_ROW: dict[str, int] = {
    "wall": 1, "floor": 4, "ceiling": 6, "bed": 8, "window": 9, "cabinet": 11, "person": 13, "door": 15, "table": 16,
    "curtain": 19, "chair": 20, "picture": 23, "sofa": 24, "shelves": 25, "mirror": 28, "floor mat": 29,
    "desk": 16, "bookshelf": 25, "dresser": 11, "night stand": 11, "counter": 11, "blinds": 19, "shower curtain": 19,
    "whiteboard": 23, "television": 23, "refridgerator": 11,
}  # fmt: skip
"""Which ADE20K output each class starts from; the second half are only kin, and start lower."""

EXACT = frozenset(list(ADE_ROW)[:16])
KIN_OFFSET = -2.0
NEW_BIAS = -3.0
_ASPP = {"aspp0": "aspp.point", "pool": "aspp.pool", "proj": "aspp.project", "low": "low"}
_NORM_PART = {"0": "conv", "1": "norm"}


def convert_ade20k(network: DeepLab, path: Path) -> None:
    """Copy the starting weights into a network; call ``refresh_norms`` before training it.

    The ASPP's new atrous branches start with no say (zero columns of the projection), the head's rows come from
    the matching classes.

    Raises:
        ModelError: the file is not the expected state dict.
    """
    source = read_tensors(path)
    state = network.state_dict()
    try:
        for name, value in source.items():
            target = _target(name)
            if target is None:
                continue
            if target == "aspp.project.conv.weight":
                state[target].zero_()
                state[target][:, : value.shape[1]] = value
            else:
                state[target].copy_(value)
        _copy_head(state, source["cls.weight"], source["cls.bias"])
    except (KeyError, RuntimeError) as error:
        raise ModelError(f"{path} does not hold the weights of a DeepLabv3+ MobileNetV2: {error}.") from error
    network.load_state_dict(state)


def _target(name: str) -> str | None:
    """Our name of a source tensor, or None where it is not copied."""
    if name.endswith("num_batches_tracked") or name.startswith("cls."):
        return None
    if match := re.fullmatch(r"f\.0\.([01])\.(\w+)", name):
        return f"encoder.stem.{_NORM_PART[match[1]]}.{match[2]}"
    if match := re.fullmatch(r"f\.(\d+)\.conv\.(\d)\.([01])\.(\w+)", name):
        first = "depthwise" if match[1] == "1" else "expand"
        part = first if match[2] == "0" else "depthwise"
        return f"encoder.blocks.{int(match[1]) - 1}.{part}.{_NORM_PART[match[3]]}.{match[4]}"
    if match := re.fullmatch(r"f\.(\d+)\.conv\.(\d)\.(\w+)", name):
        part = "conv" if match[2] == ("1" if match[1] == "1" else "2") else "norm"
        return f"encoder.blocks.{int(match[1]) - 1}.project.{part}.{match[3]}"
    if match := re.fullmatch(r"d([01])\.([01])\.([01])\.(\w+)", name):
        return f"decoder.{match[1]}.{match[2]}.{_NORM_PART[match[3]]}.{match[4]}"
    if match := re.fullmatch(r"(\w+)\.([01])\.(\w+)", name):
        return f"{_ASPP[match[1]]}.{_NORM_PART[match[2]]}.{match[3]}"
    raise KeyError(name)


def _copy_head(state: dict[str, Tensor], weight: Tensor, bias: Tensor) -> None:
    for row, name in enumerate(NYU40_NAMES[1:]):
        if name in ADE_ROW:
            state["classifier.weight"][row] = weight[ADE_ROW[name]]
            state["classifier.bias"][row] = bias[ADE_ROW[name]] + (0.0 if name in EXACT else KIN_OFFSET)
        else:
            state["classifier.weight"][row] *= 0.3
            state["classifier.bias"][row] = NEW_BIAS


@torch.no_grad()
def refresh_norms(network: DeepLab, images: Tensor) -> None:
    """Give folded batch norms (mean 0, variance 1) the real statistics of ``images``, the function unchanged.

    A folded norm put into training mode normalises what was never to be normalised. So mean and variance are
    measured, and scale and shift are set to undo them.

    Args:
        network: a converted network.
        images: (B, 3, H, W) in -1..1.
    """
    network.eval()
    statistics: dict[nn.BatchNorm2d, tuple[Tensor, Tensor]] = {}

    def note(module: nn.Module, inputs: tuple[Tensor, ...], _output: Tensor) -> None:
        assert isinstance(module, nn.BatchNorm2d)
        statistics[module] = (inputs[0].mean((0, 2, 3)), inputs[0].var((0, 2, 3), unbiased=False))

    norms = [m.norm for m in network.modules() if isinstance(m, ConvNorm)]
    handles = [norm.register_forward_hook(note) for norm in norms]
    network(images)
    for handle in handles:
        handle.remove()
    for norm, (mean, variance) in statistics.items():
        old_mean, old_variance = norm.get_buffer("running_mean"), norm.get_buffer("running_var")
        slope = norm.weight / torch.sqrt(old_variance + norm.eps)
        norm.bias.add_((mean - old_mean) * slope)
        norm.weight.copy_(slope * torch.sqrt(variance + norm.eps))
        old_mean.copy_(mean)
        old_variance.copy_(variance)
