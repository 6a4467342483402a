"""DeepLabv3+ with MobileNetV2 in place of Xception (the paper's Figures 1 and 2).

Images are RGB scaled to -1..1, their sides multiples of 16. Strided convolutions pad as TensorFlow's SAME does
(one row and column at the bottom right, sizes being even), since the starting weights were trained so: with
symmetric padding the features shift by half a cell at each of the four levels.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from semslam.loop.segmentation.network.fast_layers import dilated_depthwise, enlarge

LOW_CHANNELS = 48
ASPP_CHANNELS = 256
DECODER_CHANNELS = 256
ATROUS_RATES = (3, 6, 9)
# expansion, channels, blocks, stride (Sandler et al., CVPR 2018, Table 2); the last stride of 2 is given up for
# a dilation of 2, which keeps the encoder at output stride 16.
MOBILENET_STAGES = ((1, 16, 1, 1), (6, 24, 2, 2), (6, 32, 3, 2), (6, 64, 4, 2), (6, 96, 3, 1), (6, 160, 3, 1))
DILATED_FROM = 160
LOW_LEVEL_BLOCK = 2
FEATURE_BLOCK = 12


class Encoding(NamedTuple):
    """Features from an encoder: ``low`` at 1/4, ``middle`` and ``high`` at 1/16 of the image's size."""

    low: Tensor
    middle: Tensor
    high: Tensor


class ConvNorm(nn.Module):
    """Convolution, batch norm and ReLU6 with TensorFlow's SAME padding."""

    def __init__(
        self, inside: int, out: int, kernel: int = 1, stride: int = 1, dilation: int = 1, groups: int = 1,
        activate: bool = True,
    ) -> None:  # fmt: skip
        super().__init__()
        self.stride = stride
        padding = dilation * (kernel - 1) // 2 if stride == 1 else 0
        self.conv = nn.Conv2d(inside, out, kernel, stride, padding, dilation, groups, bias=False)
        self.norm = nn.BatchNorm2d(out, eps=1e-3, momentum=0.05)
        self.activation = nn.ReLU6() if activate else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        """(B, inside, H, W) to (B, out, H / stride, W / stride)."""
        if self.stride == 2 and self.conv.kernel_size[0] == 3:
            x = F.pad(x, (0, 1, 0, 1))
        if self.training and self.conv.dilation[0] > 1:
            x = dilated_depthwise(x, self.conv.weight, self.conv.dilation[0])
        else:
            x = self.conv(x)
        out: Tensor = self.activation(self.norm(x))
        return out


class SeparableConv(nn.Sequential):
    """Depthwise then pointwise convolution, each with norm and activation."""

    def __init__(self, inside: int, out: int, dilation: int = 1) -> None:
        super().__init__(ConvNorm(inside, inside, 3, dilation=dilation, groups=inside), ConvNorm(inside, out))


class InvertedResidual(nn.Module):
    """MobileNetV2's block: expand, filter each channel, project without activation."""

    def __init__(self, inside: int, out: int, expansion: int, stride: int, dilation: int) -> None:
        super().__init__()
        wide = inside * expansion
        self.expand = ConvNorm(inside, wide) if expansion > 1 else nn.Identity()
        self.depthwise = ConvNorm(wide, wide, 3, stride, dilation, groups=wide)
        self.project = ConvNorm(wide, out, activate=False)
        self.residual = stride == 1 and inside == out

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return the block's output and its filtered, still expanded features."""
        filtered = self.depthwise(self.expand(x))
        out = self.project(filtered)
        return (x + out if self.residual else out), filtered


class Encoder(nn.Module):
    """Base of the encoders: names the channels of its ``Encoding``, and its layers down to a quarter."""

    low_channels: int
    middle_channels: int
    high_channels: int

    def early_layers(self) -> list[nn.Module]:
        """The layers at a half and a quarter of the image's size."""
        raise NotImplementedError


class MobileNetV2(Encoder):
    """The encoder at output stride 16; its low-level features are block 3's expanded ones at stride 4."""

    low_channels, middle_channels, high_channels = 144, 96, 320

    def __init__(self) -> None:
        super().__init__()
        self.stem = ConvNorm(3, 32, 3, stride=2)
        blocks, inside = [], 32
        for expansion, out, count, first_stride in (*MOBILENET_STAGES, (6, 320, 1, 1)):
            for i in range(count):
                dilation = 2 if out > DILATED_FROM or (out == DILATED_FROM and i > 0) else 1
                blocks.append(InvertedResidual(inside, out, expansion, first_stride if i == 0 else 1, dilation))
                inside = out
        self.blocks = nn.ModuleList(blocks)

    def early_layers(self) -> list[nn.Module]:
        """The stem and the first three blocks."""
        return [self.stem, *self.blocks[: LOW_LEVEL_BLOCK + 1]]

    def forward(self, x: Tensor) -> Encoding:
        """Encode images (B, 3, H, W)."""
        x = self.stem(x)
        low = middle = x
        for i, block in enumerate(self.blocks):
            x, filtered = block(x)
            if i == LOW_LEVEL_BLOCK:
                low = filtered
            if i == FEATURE_BLOCK:
                middle = x
        return Encoding(low, middle, x)


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
    """

    def __init__(
        self, encoder: Encoder, classes: int = 40, dropout: float = 0.1, decoder_channels: int = DECODER_CHANNELS
    ) -> None:
        super().__init__()
        self.decoder_channels = decoder_channels
        self.encoder = encoder
        self.aspp = AtrousPyramid(encoder.high_channels)
        self.low = ConvNorm(encoder.low_channels, LOW_CHANNELS)
        self.decoder = nn.Sequential(
            SeparableConv(ASPP_CHANNELS + LOW_CHANNELS, decoder_channels),
            SeparableConv(decoder_channels, decoder_channels),
        )
        self.dropout = nn.Dropout2d(dropout)
        self.classifier = nn.Conv2d(decoder_channels, classes, 1)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Images (B, 3, H, W) to logits (B, classes, H/4, W/4) and mid-level features (B, C, H/16, W/16)."""
        encoding = self.encoder(x)
        low = self.low(encoding.low)
        high = self.aspp(encoding.high)
        high = enlarge(high, 4) if self.training else F.interpolate(high, scale_factor=4, mode="bilinear")
        decoded = self.decoder(torch.cat([high, low], 1))
        return self.classifier(self.dropout(decoded)), encoding.middle


def to_input(images: Sequence[npt.NDArray[np.uint8]]) -> Tensor:
    """RGB images (H, W, 3) as the network's input (B, 3, H, W) in -1..1."""
    return torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2).float() / 127.5 - 1.0


def build_mobilenet_deeplab(classes: int = 40, decoder_channels: int = DECODER_CHANNELS) -> DeepLab:
    """The paper's network with a MobileNetV2: 40 NYUv2 classes."""
    return DeepLab(MobileNetV2(), classes, decoder_channels=decoder_channels)


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
