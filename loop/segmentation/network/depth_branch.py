"""The depth branch: an encoder of its own for depth, joined to the colour network where that decides.

Its features stand beside the colour encoder's where the ASPP and the decoder read those. The colour encoder itself
never sees depth, so that the features by which detectors know places are the same with depth and without.
"""

from typing import NamedTuple

from torch import Tensor, nn

from semslam.loop.segmentation.network.encoder import FEATURE_BLOCK, LOW_LEVEL_BLOCK, ConvNorm, MobileNetV2

LOW_CHANNELS, HIGH_CHANNELS = 48, 96


class DepthFeatures(NamedTuple):
    """Features of depth: ``low`` (B, 48) at 1/4 of the colour image's size, ``high`` (B, 96) at 1/16."""

    low: Tensor
    high: Tensor


class DepthBranch(nn.Module):
    """MobileNetV2's first thirteen blocks on a depth picture of half the colour image's size."""

    def __init__(self) -> None:
        super().__init__()
        encoder = MobileNetV2()
        self.stem = encoder.stem
        self.blocks = encoder.blocks[: FEATURE_BLOCK + 1]
        # The picture has half the size already, so that this block must not halve it once more.
        halving = self.blocks[1].get_submodule("depthwise")
        assert isinstance(halving, ConvNorm)
        halving.keep_size()
        self.low = ConvNorm(MobileNetV2.low_channels, LOW_CHANNELS)

    def forward(self, x: Tensor) -> DepthFeatures:
        """Encode depth pictures (B, 3, H / 2, W / 2) in -1..1."""
        x = low = self.stem(x)
        for i, block in enumerate(self.blocks):
            x, filtered = block(x)
            if i == LOW_LEVEL_BLOCK:
                low = filtered
        return DepthFeatures(self.low(low), x)
