"""Training on folders in NYUv2's layout: resumable at any step, deterministic for a seed."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from semslam.config import Config
from semslam.errors import ConfigError, ModelError
from semslam.loop.segmentation.decoding import input_size
from semslam.loop.segmentation.network.checkpoint import (
    load_network,
    network_of,
    read_tensors,
    save_atomically,
    save_weights,
)
from semslam.loop.segmentation.network.export import write_calibrated
from semslam.loop.segmentation.network.narrowing import narrow_decoder, plain_views
from semslam.loop.segmentation.network.network import (
    DECODER_CHANNELS,
    DeepLab,
    add_depth_branch,
    build_mobilenet_deeplab,
)
from semslam.loop.segmentation.network.pretrained import convert_ade20k, refresh_norms
from semslam.loop.segmentation.network.xception import Xception65, build_xception_deeplab
from semslam.loop.segmentation.training.depth_head import DepthHead
from semslam.loop.segmentation.training.examples import ExampleSource
from semslam.loop.segmentation.training.optimisation import (
    learning_rate,
    make_optimizer,
    mixed_precision,
    old_norms,
    soft_cross_entropy,
)
from semslam.loop.segmentation.training.training_log import plot_log, write_row

LOG_STEPS = 20
NORM_IMAGES = 16


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a training: steps done, steps in all, and the last step's loss."""

    step: int
    steps: int
    loss: float


def train(directory: Path, config: Config, out: Path, report: Callable[[Progress], None] = lambda _: None) -> Path:
    """Train the network on ``directory/train.txt``; resumes a training that was killed.

    Writes in ``out``: ``state.pt`` (to resume), ``training.csv`` (step, rate, loss) and ``weights.pt`` (float16
    average of the weights), all current at every save; at the end ``weights.onnx`` (int8, calibrated on photos of
    the training part) and ``training.png`` (the log as a curve). Both kinds of weights do as the setting
    ``segmentation.weights``.

    Args:
        directory: in the NYUv2 layout.
        config: its sections ``training`` and ``segmentation`` (size of the views) and its seed count.
        out: folder of this training alone.
        report: called after each step.

    Returns:
        The path of the float16 weights.

    Raises:
        DatasetError: the folder is not in the NYUv2 layout.
        ModelError: the starting weights or the state to resume do not fit.
        ConfigError: the input size does not fit the network.
    """
    torch.set_num_threads(config.training.threads)
    run = _Run(directory, config, out)
    run.resume()
    while run.step < run.steps:
        report(Progress(run.step + 1, run.steps, run.advance()))
        if run.step % LOG_STEPS == 0:
            run.log()
        if run.save_is_due():
            run.save()
    return run.finish()


class _Run:
    """One training with all that must survive a kill."""

    def __init__(self, directory: Path, config: Config, out: Path) -> None:
        settings = self.settings = config.training
        self.seed, self.out = config.seed, out
        self.size = input_size(config.segmentation)
        self.source = ExampleSource(directory, config, out / "taught")
        self.steps = max(1, settings.epochs * len(self.source.photos) // settings.batch)
        self.step = 0
        torch.manual_seed(self.seed)
        self.network = self._beginning()
        self.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.frozen = self.network.encoder.early_layers() if settings.freeze_early else []
        if settings.encoder_rate == 0:
            self.frozen = [self.network.encoder]
        for layer in self.frozen:
            layer.requires_grad_(False)
        if settings.freeze_norms:
            self.frozen += old_norms(self.network)
        self.depth_head = None if self.network.depth is None else DepthHead(self.network.depth)
        self.average = {k: v.detach().clone() for k, v in self.network.state_dict().items()}
        self.optimizer = make_optimizer(self.network, self.depth_head, settings)
        self.losses: list[float] = []
        self.saved_at = time.monotonic()

    def _beginning(self) -> DeepLab:
        """The network before the first step."""
        path, channels = self.settings.start, self.settings.decoder_channels
        xception = self.settings.backbone == "xception65"
        if xception and self.settings.depth:
            raise ConfigError("Only a network with training.backbone=mobilenetv2 can see depth.")
        if path is None:
            build = build_xception_deeplab if xception else build_mobilenet_deeplab
            network = build(decoder_channels=channels or DECODER_CHANNELS)
        elif "cls.weight" in read_tensors(path):
            network = build_mobilenet_deeplab()
            convert_ade20k(network, path)
            refresh_norms(network, self.source.batch(np.random.default_rng((self.seed, 0)), NORM_IMAGES)[0][0])
        else:
            network = load_network(path)
        if isinstance(network.encoder, Xception65) != xception:
            raise ConfigError(f"The network of {path} has another encoder than training.backbone.")
        if channels is not None:
            # Whole photos, whatever the seed: trainings from one start keep the same channels and have a mean.
            network = narrow_decoder(network, channels, plain_views(self.source.photos, self.size))
        if network.depth is None:
            return add_depth_branch(network) if self.settings.depth else network
        if not self.settings.depth:
            raise ConfigError(f"The network of {path} sees depth; it is trained on with training.depth=true.")
        return network

    def advance(self) -> float:
        """One step of the optimiser, whose views depend on seed and step alone; returns its loss."""
        share = learning_rate(self.step, self.steps, self.settings.warmup)
        for group in self.optimizer.param_groups:
            group["lr"] = group["peak"] * share
        torch.manual_seed(self.seed * 1_000_003 + self.step)
        inputs, targets = self.source.batch(np.random.default_rng((self.seed, 1, self.step)), self.settings.batch)
        self.network.train()
        for layer in self.frozen:
            layer.eval()
        with mixed_precision():
            logits, _ = self.network(*(part.contiguous(memory_format=torch.channels_last) for part in inputs))
            from_depth = None if self.depth_head is None else self.depth_head()
        loss = soft_cross_entropy(logits.float(), targets)
        if from_depth is not None:
            loss = loss + self.settings.depth_loss * soft_cross_entropy(from_depth.float(), targets)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
        self.optimizer.step()
        self.step += 1
        self._move_average()
        self.losses.append(loss.item())
        return self.losses[-1]

    @torch.no_grad()
    def _move_average(self) -> None:
        # A young average follows faster, or it would still hold the starting weights.
        keep = min(self.settings.average, (1 + self.step) / (10 + self.step))
        for name, value in self.network.state_dict().items():
            if value.is_floating_point():
                self.average[name].lerp_(value, 1.0 - keep)
            else:
                self.average[name].copy_(value)

    def log(self) -> None:
        """Append the mean loss since the last call to the log."""
        loss, self.losses = float(np.mean(self.losses)), []
        write_row(self.out / "training.csv", self.step, self.optimizer.param_groups[-1]["lr"], loss)

    def save_is_due(self) -> bool:
        return time.monotonic() - self.saved_at > self.settings.save_every

    def save(self) -> None:
        """Write the state to resume from and the averaged weights."""
        state = {
            "step": self.step, "steps": self.steps, "network": self.network.state_dict(), "average": self.average,
            "optimizer": self.optimizer.state_dict(),
            "depth_head": {} if self.depth_head is None else self.depth_head.state_dict(),
        }  # fmt: skip
        save_atomically(state, self.out / "state.pt")
        save_weights(self._averaged(), self.out / "weights.pt")
        self.saved_at = time.monotonic()

    def _averaged(self) -> DeepLab:
        return network_of(self.average)

    def finish(self) -> Path:
        """Save all, and write the int8 graph and the learning curve."""
        self.save()
        write_calibrated(self._averaged(), self.out / "weights.onnx", self.source.photos, self.size)
        if (self.out / "training.csv").exists():
            plot_log(self.out / "training.csv", self.out / "training.png")
        return self.out / "weights.pt"

    def resume(self) -> None:
        """Load the state of a training that was killed, if there is one."""
        path = self.out / "state.pt"
        if not path.exists():
            return
        try:
            state: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
            self.network.load_state_dict(state["network"])
            self.optimizer.load_state_dict(state["optimizer"])
            if self.depth_head is not None:
                self.depth_head.load_state_dict(state["depth_head"])
            self.average, self.step = state["average"], state["step"]
            steps = state["steps"]
        except Exception as error:  # torch raises many kinds for a damaged file
            raise ModelError(f"The training state {path} is damaged; remove it to start afresh.") from error
        if steps != self.steps:
            raise ModelError(f"The training in {self.out} was begun with other settings; choose another folder.")
