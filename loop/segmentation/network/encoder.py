"""MobileNetV2 as DeepLabv3+'s encoder, and the layers that the network is made of.

Images are RGB scaled to -1..1, their sides multiples of 16. Strided convolutions pad as TensorFlow's SAME does
(one row and column at the bottom right, sizes being even), since the starting weights were trained so: with
symmetric padding the features shift by half a cell at each of the four levels.
"""

from typing import NamedTuple

import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from semslam.loop.segmentation.network.fast_layers import dilated_depthwise

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

    def keep_size(self) -> None:
        """Give up the stride; the weights stay."""
        self.stride, self.conv.stride = 1, (1, 1)
        self.conv.padding = ((self.conv.kernel_size[0] - 1) // 2,) * 2

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
