"""What the network is trained on: a view with its target, and views that hold a patch of another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from semslam.loop.segmentation.network.network import to_input
from semslam.types import Float32Array, UInt8Array

GREY = 127


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """A view and what is to be said of it.

    Attributes:
        color: (H, W, 3) uint8 RGB.
        target: (H/4, W/4, 40) float32, a weight for each class, all 0 where void.
        picture: (H/2, W/2, 3) uint8 of the view's depth, for a network that sees depth.
    """

    color: UInt8Array
    target: Float32Array
    picture: UInt8Array | None = None

    def paste(self, other: "Example", rng: np.random.Generator) -> None:
        """Paste a rectangle of another example over this one, so that objects appear out of context (CutMix).

        CutMix (Yun et al., ICCV 2019), for segmentation after French et al. (BMVC 2020). The rectangle covers about a
        tenth to a half of the view.
        """
        area, stretch = rng.uniform(0.1, 0.5), np.exp(rng.uniform(-0.5, 0.5))
        cells = []
        for side, share in zip(self.target.shape, (np.sqrt(area) / stretch, np.sqrt(area) * stretch), strict=False):
            length = min(side, max(1, round(side * share)))
            first = int(rng.integers(side - length + 1))
            cells.append((first, first + length))
        for mine, theirs in ((self.color, other.color), (self.picture, other.picture), (self.target, other.target)):
            if mine is not None and theirs is not None:
                stride = mine.shape[0] // self.target.shape[0]
                rows, columns = (slice(stride * first, stride * last) for first, last in cells)
                mine[rows, columns] = theirs[rows, columns]

    def hide(self, color: float, depth: float, rng: np.random.Generator) -> None:
        """Take the colour or the depth away, with the given probabilities; never both."""
        drawn = rng.random()
        if self.picture is None:
            return
        if drawn < depth:
            self.picture[:] = 0
        elif drawn < depth + color:
            self.color[:] = GREY


def to_batch(examples: Sequence[Example]) -> tuple[list[Tensor], Tensor]:
    """Inputs (B, 3, H, W), and (B, 3, H/2, W/2) where there is depth, and targets (B, 40, H/4, W/4) for the network."""
    inputs = [to_input([example.color for example in examples])]
    pictures = [example.picture for example in examples if example.picture is not None]
    if pictures:
        inputs.append(to_input(pictures))
    targets = torch.from_numpy(np.stack([example.target for example in examples])).permute(0, 3, 1, 2)
    return inputs, targets
