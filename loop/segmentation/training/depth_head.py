"""A head of the depth branch's own, which has to name the classes from depth alone; used in training only.

The colour network knows its training photos so well that little is left to learn from depth. A loss on the branch by
itself (deep supervision, Lee et al., AISTATS 2015) teaches it what depth shows all the same.
"""

import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from semslam.loop.segmentation.network.depth_branch import HIGH_CHANNELS, LOW_CHANNELS, DepthBranch, DepthFeatures
from semslam.loop.segmentation.network.fast_layers import enlarge


class DepthHead(nn.Module):
    """Logits of the depth branch's last features."""

    def __init__(self, branch: DepthBranch, classes: int = 40) -> None:
        super().__init__()
        self.high = nn.Conv2d(HIGH_CHANNELS, classes, 1)
        self.low = nn.Conv2d(LOW_CHANNELS, classes, 1)
        self._seen: DepthFeatures | None = None
        branch.register_forward_hook(self._keep)

    def _keep(self, _branch: nn.Module, _inputs: object, seen: DepthFeatures) -> None:
        self._seen = seen

    def forward(self) -> Tensor:
        """Logits (B, classes, H/4, W/4) for what the branch has just encoded."""
        assert self._seen is not None
        seen, self._seen = self._seen, None
        logits: Tensor = enlarge(self.high(F.dropout2d(seen.high, 0.1, self.training)), 4) + self.low(seen.low)
        return logits
