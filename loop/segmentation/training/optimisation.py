"""How a step of the training is made: rates, loss and arithmetic."""

from contextlib import nullcontext
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from semslam.config import TrainingConfig
from semslam.loop.segmentation.network.network import DeepLab
from semslam.loop.segmentation.training.depth_head import DepthHead


def learning_rate(step: int, steps: int, warmup: float) -> float:
    """Share of the peak rate: linear warm-up, then a cosine to zero."""
    rise = max(1, round(steps * warmup))
    if step < rise:
        return (step + 1) / rise
    return 0.5 * (1.0 + float(np.cos(np.pi * (step - rise) / max(1, steps - rise))))


def soft_cross_entropy(logits: Tensor, targets: Tensor) -> Tensor:
    """Cross-entropy of logits (B, C, h, w) with class weights of the same shape, by their sum; 0 where all are void."""
    return -(F.log_softmax(logits, 1) * targets).sum() / targets.sum().clamp(min=1e-6)


def make_optimizer(network: DeepLab, depth_head: DepthHead | None, settings: TrainingConfig) -> torch.optim.AdamW:
    """AdamW with the peak rate of each part of the network, as ``peak`` in its groups."""
    groups: list[dict[str, Any]] = []
    encoder = list(network.encoder.parameters())
    branch = [] if network.depth is None else list(network.depth.parameters())
    branch += [] if depth_head is None else list(depth_head.parameters())
    apart = {id(p) for p in (*encoder, *branch)}
    rest = [p for p in network.parameters() if id(p) not in apart]
    known = settings.rate if network.depth is None else settings.rate * settings.known_rate
    for parameters, peak in ((encoder, known * settings.encoder_rate), (rest, known), (branch, settings.rate)):
        for decays in (True, False):
            chosen = [p for p in parameters if (p.ndim > 1) == decays and p.requires_grad]
            if chosen:
                groups.append({"params": chosen, "peak": peak, "weight_decay": settings.weight_decay * decays})
    return torch.optim.AdamW(groups, lr=settings.rate)


def old_norms(network: DeepLab) -> list[torch.nn.Module]:
    """The batch norms outside the depth branch, which has no statistics of depth to keep."""
    return [
        module
        for name, module in network.named_modules()
        if isinstance(module, torch.nn.BatchNorm2d) and not name.startswith("depth.")
    ]


def mixed_precision() -> Any:
    """bfloat16 where the processor computes in it, else nothing."""
    return torch.autocast("cpu", torch.bfloat16) if torch.ops.mkldnn._is_mkldnn_bf16_supported() else nullcontext()
