"""Learns the shipped place network: dense layers on the frozen encoder that name the type of a room."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from semslam.loop.detectors.placecnn.network import PlaceHead
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.types import Float32Array, UInt8Array

SIZES = (128, 64)
"""Units of the dense layers before the last."""
EPOCHS, BATCH, RATE, DECAY, DROPPED = 60, 64, 1e-3, 1e-2, 0.5
MIN_SHARE = 0.01
"""Share of a photo that a class must cover to count for the type of the room."""
ROOM_TYPES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("bathroom", ("toilet", "bathtub", "shower curtain")),
    ("bedroom", ("bed", "night stand")),
    ("kitchen", ("refridgerator", "counter")),
    ("living room", ("sofa",)),
    ("office", ("desk", "whiteboard")),
    ("library", ("bookshelf", "books")),
    ("dining room", ("table",)),
    ("other", ()),
)
"""Types of rooms, and the classes that show each; the first that fits is taken."""


def room_type(labels: UInt8Array) -> int:
    """The type of the room that a label image (H, W) of NYUv2's classes shows, as an index into ``ROOM_TYPES``.

    The photos come without scene types, so they are derived from what the label images show.
    """
    shares = np.bincount(labels.ravel(), minlength=len(NYU40_NAMES)) / labels.size
    seen = {name for name, share in zip(NYU40_NAMES, shares.tolist(), strict=False) if share >= MIN_SHARE}
    return next(i for i, (_, signs) in enumerate(ROOM_TYPES) if not signs or seen & set(signs))


def train_head(pooled: Float32Array, types: Sequence[int], seed: int) -> PlaceHead:
    """Train the dense layers.

    Args:
        pooled: (N, 832) pooled features of views.
        types: (N,) the type of each view's room.
        seed: of weights, order and dropout.
    """
    import torch
    from torch import nn

    torch.manual_seed(seed)
    mean, deviation = pooled.mean(axis=0), pooled.std(axis=0)
    inputs = torch.from_numpy(((pooled - mean) / (deviation + 1e-3)).astype(np.float32))
    truth = torch.as_tensor(types)
    widths = (inputs.shape[1], *SIZES, len(ROOM_TYPES))
    dense = [nn.Linear(*pair) for pair in pairwise(widths)]
    network = nn.Sequential(
        nn.Dropout(DROPPED), dense[0], nn.ReLU(), nn.Dropout(DROPPED), dense[1], nn.ReLU(), dense[2]
    )
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
    for _ in range(EPOCHS):
        order = torch.randperm(len(inputs))
        for start in range(0, len(order), BATCH):
            chosen = order[start : start + BATCH]
            loss = nn.functional.cross_entropy(network(inputs[chosen]), truth[chosen])
            optimizer.zero_grad()
            torch.autograd.backward(loss)
            optimizer.step()
    weights = tuple(layer.weight.detach().numpy() for layer in dense)
    return PlaceHead(mean, deviation, weights, tuple(layer.bias.detach().numpy() for layer in dense))
