"""A stacked denoising autoencoder (Vincent et al., JMLR 2010): trained with PyTorch, run with numpy."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from semslam.loop.detectors.common.weight_file import open_weights
from semslam.types import Float32Array

DROPPED = 0.3
SPARSITY, SPARSITY_WEIGHT = 0.05, 0.01
BATCH, EPOCHS, RATE = 128, 8, 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Autoencoder:
    """The encoding half.

    Attributes:
        weights: (out, in) of each layer.
        biases: (out,) of each layer.
        mean: (D,) of the training codes.
        deviation: (D,) of the training codes.
    """

    weights: tuple[Float32Array, ...]
    biases: tuple[Float32Array, ...]
    mean: Float32Array
    deviation: Float32Array

    @property
    def size(self) -> int:
        """Length of a code."""
        return len(self.mean)

    def hidden(self, patches: Float32Array) -> Float32Array:
        """Sigmoid responses (N, D) of the last layer to patches (N, in) in 0..1."""
        out = patches
        for weight, bias in zip(self.weights, self.biases, strict=True):
            out = (1 / (1 + np.exp(-(out @ weight.T + bias)))).astype(np.float32)
        return out

    def encode(self, patches: Float32Array) -> Float32Array:
        """Whitened codes (N, D) of unit length."""
        codes = (self.hidden(patches) - self.mean) / (self.deviation + 1e-3)
        return np.asarray(codes / np.maximum(np.linalg.norm(codes, axis=1, keepdims=True), 1e-6), dtype=np.float32)

    def save(self, path: Path) -> None:
        """Write it as a compressed npz of float16."""
        arrays: dict[str, Any] = {f"weight_{i}": w.astype(np.float16) for i, w in enumerate(self.weights)}
        arrays |= {f"bias_{i}": b.astype(np.float16) for i, b in enumerate(self.biases)}
        np.savez_compressed(path, mean=self.mean, deviation=self.deviation, **arrays)


def load_autoencoder(path: Path) -> Autoencoder:
    """Read the weights.

    Raises:
        ModelError: the file is missing or damaged.
    """
    with open_weights(path, "autoencoder") as arrays:
        layers = range(len(arrays) // 2 - 1)
        weights = tuple(arrays[f"weight_{i}"].astype(np.float32) for i in layers)
        biases = tuple(arrays[f"bias_{i}"].astype(np.float32) for i in layers)
        mean, deviation = (arrays[name].astype(np.float32) for name in ("mean", "deviation"))
        return Autoencoder(weights, biases, mean, deviation)


def train_autoencoder(patches: Float32Array, sizes: tuple[int, ...], seed: int) -> Autoencoder:
    """Train layer by layer: give back the patch from one with pixels dropped, with sparse responses.

    Args:
        patches: (N, in) in 0..1.
        sizes: units of each layer.
        seed: of weights, order and noise.
    """
    import torch

    torch.manual_seed(seed)
    inputs = torch.from_numpy(patches)
    weights, biases = [], []
    for size in sizes:
        encoder, decoder = torch.nn.Linear(inputs.shape[1], size), torch.nn.Linear(size, inputs.shape[1])
        optimizer = torch.optim.Adam([*encoder.parameters(), *decoder.parameters()], RATE)
        for _ in range(EPOCHS):
            order = torch.randperm(len(inputs))
            for start in range(0, len(order), BATCH):
                clean = inputs[order[start : start + BATCH]]
                code = torch.sigmoid(encoder(clean * (torch.rand_like(clean) > DROPPED)))
                activity = code.mean(0).clamp(1e-4, 1 - 1e-4)
                sparse = SPARSITY * torch.log(SPARSITY / activity)
                sparse = sparse + (1 - SPARSITY) * torch.log((1 - SPARSITY) / (1 - activity))
                error = ((torch.sigmoid(decoder(code)) - clean) ** 2).sum(1).mean()
                optimizer.zero_grad()
                torch.autograd.backward(error + SPARSITY_WEIGHT * sparse.sum())
                optimizer.step()
        with torch.no_grad():
            inputs = torch.sigmoid(encoder(inputs))
        weights.append(encoder.weight.detach().numpy())
        biases.append(encoder.bias.detach().numpy())
    codes = inputs.numpy()
    return Autoencoder(tuple(weights), tuple(biases), codes.mean(axis=0), codes.std(axis=0))
