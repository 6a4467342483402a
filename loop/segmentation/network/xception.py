"""Aligned Xception-65, the backbone that the paper replaces, for comparison.

Chen et al., ECCV 2018, Figure 4. No weights are shipped; ``training.backbone`` trains them.
"""

import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from semslam.loop.segmentation.network.encoder import ConvNorm, Encoder, Encoding
from semslam.loop.segmentation.network.network import DECODER_CHANNELS, DeepLab

MIDDLE_BLOCKS = 16


class _Separable(nn.Sequential):
    """Depthwise and pointwise convolution with a norm each; the activation stands before or after both."""

    def __init__(self, inside: int, out: int, stride: int = 1, dilation: int = 1, inner: bool = False) -> None:
        before = [] if inner else [nn.ReLU()]
        super().__init__(
            *before,
            ConvNorm(inside, inside, 3, stride, dilation, groups=inside, activate=inner),
            ConvNorm(inside, out, activate=inner),
        )


class XceptionBlock(nn.Module):
    """Three separable convolutions beside a shortcut.

    Args:
        inside: channels that come in.
        outs: channels after each convolution.
        stride: of the last convolution and of the shortcut.
        dilation: of all three.
        shortcut: "conv", "sum" or "none".
        inner: activations after each convolution instead of before each pair (exit flow's last block).
    """

    def __init__(
        self, inside: int, outs: tuple[int, int, int], stride: int = 1, dilation: int = 1, shortcut: str = "conv",
        inner: bool = False,
    ) -> None:  # fmt: skip
        super().__init__()
        a, b, c = outs
        self.first = _Separable(inside, a, dilation=dilation, inner=inner)
        self.second = _Separable(a, b, dilation=dilation, inner=inner)
        self.third = _Separable(b, c, stride, dilation, inner)
        self.stride, self.kind = stride, shortcut
        self.shortcut = ConvNorm(inside, c, activate=False) if shortcut == "conv" else nn.Identity()

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return the block's output and that of its second convolution."""
        middle = self.second(self.first(x))
        out = self.third(middle)
        if self.kind == "conv":
            out = out + self.shortcut(x[:, :, :: self.stride, :: self.stride])
        elif self.kind == "sum":
            out = out + x
        return out, middle


class Xception65(Encoder):
    """The encoder at output stride 16; its low-level features are the second entry block's at stride 4."""

    low_channels, middle_channels, high_channels = 256, 728, 2048

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Sequential(ConvNorm(3, 32, 3, stride=2), ConvNorm(32, 64, 3))
        self.entry = nn.ModuleList(
            [
                XceptionBlock(64, (128, 128, 128), stride=2),
                XceptionBlock(128, (256, 256, 256), stride=2),
                XceptionBlock(256, (728, 728, 728), stride=2),
            ]
        )
        self.middle = nn.ModuleList([XceptionBlock(728, (728, 728, 728), shortcut="sum") for _ in range(MIDDLE_BLOCKS)])
        self.exit = nn.ModuleList(
            [
                XceptionBlock(728, (728, 1024, 1024)),
                XceptionBlock(1024, (1536, 1536, 2048), dilation=2, shortcut="none", inner=True),
            ]
        )

    def early_layers(self) -> list[nn.Module]:
        """The stem and the first two entry blocks."""
        return [self.stem, self.entry[0], self.entry[1]]

    def forward(self, x: Tensor) -> Encoding:
        """Encode images (B, 3, H, W)."""
        x, _ = self.entry[0](self.stem(x))
        x, low = self.entry[1](x)
        x, _ = self.entry[2](x)
        for block in self.middle:
            x, _ = block(x)
        middle = x
        for block in self.exit:
            x, _ = block(x)
        return Encoding(F.relu(low), middle, x)


def build_xception_deeplab(classes: int = 40, decoder_channels: int = DECODER_CHANNELS) -> DeepLab:
    """DeepLabv3+ on Xception-65, which sees colour alone."""
    return DeepLab(Xception65(), classes, decoder_channels=decoder_channels)
