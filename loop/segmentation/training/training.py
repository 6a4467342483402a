"""Training on folders in NYUv2's layout: resumable at any step, deterministic for a seed."""

import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from semslam.config import Config, TrainingConfig
from semslam.errors import ConfigError, ModelError
from semslam.geometry.se3 import Float32Array
from semslam.loop.segmentation.classes import CLASS_COUNT
from semslam.loop.segmentation.decoding import input_size
from semslam.loop.segmentation.network.checkpoint import load_network, read_tensors, save_atomically, save_weights
from semslam.loop.segmentation.network.export import write_calibrated
from semslam.loop.segmentation.network.narrowing import narrow_decoder, plain_views
from semslam.loop.segmentation.network.network import DECODER_CHANNELS, DeepLab, build_mobilenet_deeplab, to_input
from semslam.loop.segmentation.network.pretrained import convert_ade20k, refresh_norms
from semslam.loop.segmentation.photos import Photo, UInt8Array, read_photos
from semslam.loop.segmentation.segmenters.onnx import load_graph
from semslam.loop.segmentation.training.augmentation import paste_patch, random_view
from semslam.loop.segmentation.training.self_training import TaughtPhoto, Teacher, teach
from semslam.loop.segmentation.training.training_log import plot_log, write_row

UNDER_ANSWERS = (slice(2, None, 4), slice(2, None, 4))
LOG_STEPS = 20
NORM_IMAGES = 16
WEIGHT_LIMITS = (0.3, 4.0)


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


def class_weights(photos: list[Photo]) -> Float32Array:
    """Weights (40,) that fall with the square root of a class's share of pixels, clipped, median 1."""
    counts = np.sum([np.bincount(p.labels.ravel(), minlength=CLASS_COUNT + 1)[1:] for p in photos], axis=0)
    weights = 1.0 / np.sqrt(np.maximum(counts / counts.sum(), 1e-4))
    weights = weights / np.median(weights[counts > 0])
    return np.asarray(np.clip(weights, *WEIGHT_LIMITS), dtype=np.float32)


def taught_photos(settings: TrainingConfig, folder: Path) -> list[TaughtPhoto]:
    """The unlabelled photos with the teachers' soft labels, cached in ``folder``; none without teachers.

    Raises:
        ConfigError: there are photos without teachers, or teachers without photos.
        DatasetError: the folder of unlabelled photos holds none.
        ModelError: a teacher's weights are missing or damaged.
    """
    if (settings.unlabelled is None) != (not settings.teachers):
        raise ConfigError("Self-training needs both 'training.unlabelled' and 'training.teachers'.")
    if settings.unlabelled is None:
        return []
    graphs = [load_graph(path, "float32") for path in settings.teachers]
    return teach(Teacher(graphs, threads=settings.threads), settings.unlabelled, folder)


def photos_by_class(photos: list[Photo]) -> list[list[Photo]]:
    """For each class that occurs, the photos of which it covers at least a hundredth."""
    shares = np.stack([np.bincount(p.labels.ravel(), minlength=CLASS_COUNT + 1)[1:] / p.labels.size for p in photos])
    groups = [[photo for photo, has in zip(photos, column, strict=True) if has] for column in (shares >= 0.01).T]
    return [group for group in groups if group] or [photos]


def learning_rate(step: int, steps: int, warmup: float) -> float:
    """Share of the peak rate: linear warm-up, then a cosine to zero."""
    rise = max(1, round(steps * warmup))
    if step < rise:
        return (step + 1) / rise
    return 0.5 * (1.0 + float(np.cos(np.pi * (step - rise) / max(1, steps - rise))))


class _Run:
    """One training with all that must survive a kill."""

    def __init__(self, directory: Path, config: Config, out: Path) -> None:
        settings = self.settings = config.training
        self.seed, self.out = config.seed, out
        self.size = input_size(config.segmentation)
        self.photos = read_photos(directory, "train.txt")
        self.by_class = photos_by_class(self.photos)
        self.taught = taught_photos(settings, out / "taught")
        self.steps = max(1, settings.epochs * len(self.photos) // settings.batch)
        self.step = 0
        self.target_of_label = np.vstack([np.zeros(CLASS_COUNT), np.diag(class_weights(self.photos))]).astype(
            np.float32
        )
        torch.manual_seed(self.seed)
        self.network = self._beginning()
        self.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.frozen = self.network.encoder.early_layers() if settings.freeze_early else []
        for layer in self.frozen:
            layer.requires_grad_(False)
        if settings.freeze_norms:
            self.frozen += [module for module in self.network.modules() if isinstance(module, torch.nn.BatchNorm2d)]
        self.average = {k: v.detach().clone() for k, v in self.network.state_dict().items()}
        self.optimizer = _optimizer(self.network, settings)
        self.losses: list[float] = []
        self.saved_at = time.monotonic()

    def _beginning(self) -> DeepLab:
        """The network before the first step."""
        path, channels = self.settings.start, self.settings.decoder_channels
        if path is None:
            return build_mobilenet_deeplab(decoder_channels=channels or DECODER_CHANNELS)
        if "cls.weight" in read_tensors(path):
            network = build_mobilenet_deeplab()
            convert_ade20k(network, path)
            refresh_norms(network, self._batch(np.random.default_rng((self.seed, 0)), NORM_IMAGES)[0])
        else:
            network = load_network(path)
        if channels is None:
            return network
        # Whole photos, whatever the seed: trainings from one start keep the same channels and have a mean.
        return narrow_decoder(network, channels, plain_views(self.photos, self.size))

    def _batch(self, rng: np.random.Generator, count: int) -> tuple[Tensor, Tensor]:
        """Views (B, 3, H, W) in -1..1 and targets (B, 40, H/4, W/4): a weight for each class, all 0 where void."""
        views, targets = [], []
        for _ in range(count):
            view, target = self._draw(rng)
            if rng.random() < self.settings.patch_share:
                paste_patch(view, target, *self._draw(rng), rng)
            views.append(view)
            targets.append(target)
        return to_input(views), torch.from_numpy(np.stack(targets)).permute(0, 3, 1, 2)

    def _draw(self, rng: np.random.Generator) -> tuple[UInt8Array, Float32Array]:
        """A view (H, W, 3) and its target (H/4, W/4, 40)."""
        settings = self.settings
        if self.taught and rng.random() < settings.unlabelled_share:
            chosen = self.taught[int(rng.integers(len(self.taught)))]
            view, cells = random_view(chosen.color, chosen.cells, self.size, rng, settings.strong_share)
            return view, chosen.beliefs[cells[UNDER_ANSWERS]].astype(np.float32) / np.float32(255.0)
        pool = self.photos
        if rng.random() < settings.rare_share:
            pool = self.by_class[int(rng.integers(len(self.by_class)))]
        photo = pool[int(rng.integers(len(pool)))]
        view, labels = random_view(photo.color, photo.labels, self.size, rng, settings.strong_share)
        return view, self.target_of_label[labels[UNDER_ANSWERS]]

    def advance(self) -> float:
        """One step of the optimiser, whose views depend on seed and step alone; returns its loss."""
        share = learning_rate(self.step, self.steps, self.settings.warmup)
        for group in self.optimizer.param_groups:
            group["lr"] = group["peak"] * share
        torch.manual_seed(self.seed * 1_000_003 + self.step)
        images, targets = self._batch(np.random.default_rng((self.seed, 1, self.step)), self.settings.batch)
        self.network.train()
        for layer in self.frozen:
            layer.eval()
        with _mixed_precision():
            logits, _ = self.network(images.contiguous(memory_format=torch.channels_last))
        loss = soft_cross_entropy(logits.float(), targets)
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
        }  # fmt: skip
        save_atomically(state, self.out / "state.pt")
        save_weights(self._averaged(), self.out / "weights.pt")
        self.saved_at = time.monotonic()

    def _averaged(self) -> DeepLab:
        network = build_mobilenet_deeplab(decoder_channels=self.network.decoder_channels)
        network.load_state_dict(self.average)
        return network

    def finish(self) -> Path:
        """Save all, and write the int8 graph and the learning curve."""
        self.save()
        write_calibrated(self._averaged(), self.out / "weights.onnx", self.photos, self.size)
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
            self.average, self.step = state["average"], state["step"]
            steps = state["steps"]
        except Exception as error:  # torch raises many kinds for a damaged file
            raise ModelError(f"The training state {path} is damaged; remove it to start afresh.") from error
        if steps != self.steps:
            raise ModelError(f"The training in {self.out} was begun with other settings; choose another folder.")


def soft_cross_entropy(logits: Tensor, targets: Tensor) -> Tensor:
    """Cross-entropy of logits (B, C, h, w) with class weights of the same shape, by their sum; 0 where all are void."""
    return -(F.log_softmax(logits, 1) * targets).sum() / targets.sum().clamp(min=1e-6)


def _optimizer(network: DeepLab, settings: TrainingConfig) -> torch.optim.AdamW:
    groups: list[dict[str, Any]] = []
    for part, share in ((network.encoder, settings.encoder_rate), (None, 1.0)):
        inside = {id(p) for p in network.encoder.parameters()}
        parameters = [p for p in network.parameters() if (id(p) in inside) == (part is not None)]
        for decays in (True, False):
            chosen = [p for p in parameters if (p.ndim > 1) == decays and p.requires_grad]
            groups.append(
                {"params": chosen, "peak": settings.rate * share, "weight_decay": settings.weight_decay * decays}
            )
    return torch.optim.AdamW(groups, lr=settings.rate)


def _mixed_precision() -> Any:
    """bfloat16 where the processor computes in it, else nothing."""
    return torch.autocast("cpu", torch.bfloat16) if torch.ops.mkldnn._is_mkldnn_bf16_supported() else nullcontext()
