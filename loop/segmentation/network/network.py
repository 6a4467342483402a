"""DeepLabv3+ with MobileNetV2 in place of Xception (the paper's Figures 1 and 2)."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from semslam.loop.segmentation.network import depth_branch
from semslam.loop.segmentation.network.depth_branch import DepthBranch
from semslam.loop.segmentation.network.encoder import ConvNorm, Encoder, MobileNetV2, SeparableConv
from semslam.loop.segmentation.network.fast_layers import enlarge

LOW_CHANNELS = 48
ASPP_CHANNELS = 256
DECODER_CHANNELS = 256
ATROUS_RATES = (3, 6, 9)


class AtrousPyramid(nn.Module):
    """ASPP: a 1x1 branch, atrous separable branches and image pooling, joined and projected."""

    def __init__(self, inside: int, rates: tuple[int, ...] = ATROUS_RATES) -> None:
        super().__init__()
        self.pool = ConvNorm(inside, ASPP_CHANNELS)
        self.point = ConvNorm(inside, ASPP_CHANNELS)
        self.atrous = nn.ModuleList(SeparableConv(inside, ASPP_CHANNELS, rate) for rate in rates)
        self.project = ConvNorm(ASPP_CHANNELS * (2 + len(rates)), ASPP_CHANNELS)

    def forward(self, x: Tensor) -> Tensor:
        """(B, inside, h, w) to (B, 256, h, w)."""
        pooled = self.pool(x.mean((2, 3), keepdim=True)).expand(-1, -1, *x.shape[-2:])
        branches = [pooled, self.point(x), *(branch(x) for branch in self.atrous)]
        out: Tensor = self.project(torch.cat(branches, 1))
        return out


class DeepLab(nn.Module):
    """DeepLabv3+: encoder, ASPP, and a decoder that joins the low-level features.

    Args:
        encoder: gives an ``Encoding`` and names its channels.
        classes: number of classes without void.
        dropout: share of channels dropped before the classifier in training.
        decoder_channels: outputs of both of the decoder's layers.
        depth: the branch for depth, for a network that sees depth.
    """

    def __init__(
        self, encoder: Encoder, classes: int = 40, dropout: float = 0.1, decoder_channels: int = DECODER_CHANNELS,
        depth: DepthBranch | None = None,
    ) -> None:  # fmt: skip
        super().__init__()
        self.decoder_channels = decoder_channels
        self.encoder = encoder
        self.depth = depth
        low, high = (0, 0) if depth is None else (depth_branch.LOW_CHANNELS, depth_branch.HIGH_CHANNELS)
        self.aspp = AtrousPyramid(encoder.high_channels + high)
        self.low = ConvNorm(encoder.low_channels, LOW_CHANNELS)
        self.decoder = nn.Sequential(
            SeparableConv(ASPP_CHANNELS + LOW_CHANNELS + low, decoder_channels),
            SeparableConv(decoder_channels, decoder_channels),
        )
        self.dropout = nn.Dropout2d(dropout)
        self.classifier = nn.Conv2d(decoder_channels, classes, 1)

    def forward(self, x: Tensor, depth: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Images (B, 3, H, W) to logits (B, classes, H/4, W/4) and mid-level features (B, C, H/16, W/16).

        Args:
            x: the images.
            depth: depth pictures (B, 3, H/2, W/2), for a network with a depth branch alone.
        """
        encoding = self.encoder(x)
        fine, coarse = [self.low(encoding.low)], [encoding.high]
        if self.depth is not None:
            seen = self.depth(depth)
            fine.append(seen.low)
            coarse.append(seen.high)
        high = self.aspp(torch.cat(coarse, 1))
        high = enlarge(high, 4) if self.training else F.interpolate(high, scale_factor=4, mode="bilinear")
        decoded = self.decoder(torch.cat([high, *fine], 1))
        return self.classifier(self.dropout(decoded)), encoding.middle


def to_input(images: Sequence[npt.NDArray[np.uint8]]) -> Tensor:
    """RGB images (H, W, 3) as the network's input (B, 3, H, W) in -1..1."""
    return torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2).float() / 127.5 - 1.0


def build_mobilenet_deeplab(
    classes: int = 40, decoder_channels: int = DECODER_CHANNELS, depth: bool = False
) -> DeepLab:
    """The paper's network with a MobileNetV2: 40 NYUv2 classes; with ``depth`` it sees depth as well."""
    return DeepLab(MobileNetV2(), classes, decoder_channels=decoder_channels, depth=DepthBranch() if depth else None)


@torch.no_grad()
def add_depth_branch(network: DeepLab) -> DeepLab:
    """A network that sees depth and answers as ``network`` does until it is trained.

    The branch begins with the colour encoder's weights; what reads its features begins with zeros.
    """
    grown = build_mobilenet_deeplab(network.classifier.out_channels, network.decoder_channels, depth=True)
    assert grown.depth is not None
    state = grown.state_dict()
    for name, value in network.state_dict().items():
        target = state[name]
        if target.shape == value.shape:
            target.copy_(value)
        elif target.shape[1:] == value.shape[1:]:  # a filter for each channel
            target[: len(value)] = value
        else:
            target.zero_()
            target[:, : value.shape[1]] = value
    for part in ("stem", "blocks"):
        branch, encoder = grown.depth.get_submodule(part), network.encoder.get_submodule(part)
        branch.load_state_dict(encoder.state_dict(), strict=False)
    grown.depth.low.load_state_dict(network.low.state_dict())
    return grown


def count_parameters(network: nn.Module) -> int:
    """Number of trainable parameters of a network."""
    return sum(p.numel() for p in network.parameters())


@torch.no_grad()
def count_multiply_adds(network: nn.Module, height: int, width: int) -> int:
    """Multiply-adds of the convolutions for one image of the given size."""
    total = 0

    def note(module: nn.Module, _inputs: tuple[Tensor, ...], output: Tensor) -> None:
        nonlocal total
        if isinstance(module, nn.Conv2d):
            total += output.numel() * module.weight[0].numel()

    handles = [m.register_forward_hook(note) for m in network.modules() if isinstance(m, nn.Conv2d)]
    was_training = network.training
    network.eval()(torch.zeros(1, 3, height, width))
    network.train(was_training)
    for handle in handles:
        handle.remove()
    return total
