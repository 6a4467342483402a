"""Settings of the segmenter and of its training."""

from pathlib import Path
from typing import Literal

from pydantic import Field

from semslam.config.section import Section


class SegmentationConfig(Section):
    """Which segmenter runs, and how."""

    name: str = Field("onnx", description="registered segmenter")
    weights: Path | None = Field(None, description="checkpoint; none = the shipped one")
    width: int = Field(320, gt=0, description="input width in pixels")
    height: int = Field(240, gt=0, description="input height in pixels")
    threads: int = Field(1, gt=0, description="inference threads")
    precision: Literal["int8", "float32"] = Field("int8", description="arithmetic of the shipped network")
    min_confidence: float = Field(0.0, ge=0, lt=1, description="below it a pixel becomes void; 0 = never")
    labels_dir: Path | None = Field(None, description="folder of label images for the segmenter 'folder'")
    cache_dir: Path | None = Field(None, description="where segmentations are cached by content; none = no cache")


class TrainingConfig(Section):
    """How the segmentation network is trained; the size of its input is the segmenter's."""

    backbone: Literal["mobilenetv2", "xception65"] = Field("mobilenetv2", description="the network's encoder")
    start: Path | None = Field(None, description="weights to start from: ADE20K state dict or own checkpoint")
    decoder_channels: int | None = Field(None, gt=0, description="decoder channels to prune the start to")
    epochs: int = Field(60, gt=0, description="passes over the labelled photos")
    batch: int = Field(8, gt=1, description="views in one step")
    rate: float = Field(1e-3, gt=0, description="peak learning rate of decoder and head")
    encoder_rate: float = Field(0.25, ge=0, description="learning rate of the encoder, as a share; 0 = frozen")
    weight_decay: float = Field(0.02, ge=0, description="decoupled weight decay")
    freeze_early: bool = Field(False, description="leave the encoder's stem and first blocks, to 1/4, as they are")
    freeze_norms: bool = Field(False, description="keep the batch norms' statistics as they were at the start")
    depth: bool = Field(False, description="train a network that sees depth; a start without gets a branch for it")
    known_rate: float = Field(0.15, gt=0, description="rate of all but the depth branch, as a share, if depth is seen")
    depth_loss: float = Field(0.5, ge=0, description="weight of the loss on what the depth branch says by itself")
    depth_missing: float = Field(0.2, ge=0, le=1, description="share of views without depth")
    color_missing: float = Field(0.15, ge=0, le=1, description="share of views without colour, if depth is seen")
    warmup: float = Field(0.08, ge=0, lt=1, description="share of the steps in which the rate climbs")
    average: float = Field(0.998, ge=0, lt=1, description="decay of the weight average that is kept")
    strong_share: float = Field(0.0, ge=0, le=1, description="share of views taken close, rolled, blurred, badly lit")
    patch_share: float = Field(0.0, ge=0, le=1, description="share of views that hold a patch of another view")
    rare_share: float = Field(0.0, ge=0, le=1, description="share of views drawn by class, every class as often")
    unlabelled: Path | None = Field(None, description="folder of photos without labels, for self-training")
    teachers: tuple[Path, ...] = Field((), description="weights of the networks whose mean prediction labels them")
    unlabelled_share: float = Field(0.4, ge=0, lt=1, description="share of views drawn from the unlabelled photos")
    threads: int = Field(1, gt=0, description="training threads")
    save_every: float = Field(60.0, gt=0, description="seconds between checkpoints")
