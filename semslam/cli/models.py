"""semslam segment, train-segmenter, average-segmenters, eval-segmenter."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer
from rich.table import Table

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import out
from semslam.cli.progress import bar

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semslam.config import Config
    from semslam.loop.segmentation.training.evaluation import SegmentationScore
    from semslam.loop.segmentation.training.training import Progress
    from semslam.types import Float32Array, UInt8Array

IMAGES = (".png", ".jpg", ".jpeg")

Photos = Annotated[Path, typer.Argument(help="Folder with rgb/, labels40/ and split files, as NYUv2 here.")]


def segment_command(
    path: Annotated[str, typer.Argument(help="An image, a folder of images, or a sequence.")],
    out_directory: Annotated[Path, typer.Option("--out", help="Folder for overlays and label images.")] = Path(
        "segmentation"
    ),
    every: Annotated[int, typer.Option(min=1, help="Take every n-th image.")] = 1,
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
) -> None:
    """Label images: an overlay with a legend and a label image for each; a sequence's depth is used."""
    import cv2

    from semslam.loop.segmentation.build import build_segmenter
    from semslam.loop.segmentation.overlay import draw_overlay
    from semslam.runs.files import writing

    images = list(_image_names(path))[::every]
    segmenter = build_segmenter(options.settings(config, overrides))
    with writing(out_directory), bar("segmenting", len(images), "images") as update:
        for folder in ("overlays", "labels"):
            (out_directory / folder).mkdir(parents=True, exist_ok=True)
        for done, image in enumerate(_images(path, images), start=1):
            label_map = segmenter.segment(image.color, image.depth)
            overlay = draw_overlay(image.color, label_map)
            _write(out_directory / "overlays" / f"{image.stem}.jpg", cv2.imencode(".jpg", overlay[..., ::-1])[1])
            _write(out_directory / "labels" / f"{image.stem}.png", cv2.imencode(".png", label_map.labels)[1])
            update(done, len(images))
    out.print(f"{len(images)} images labelled in {out_directory}", soft_wrap=True)


def train_command(
    directory: Photos,
    out_directory: Annotated[Path, typer.Option("--out", help="Folder of the checkpoints; resumes what is there.")],
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    seed: options.Seed = None,
) -> None:
    """Train the segmentation network; a killed training goes on where it stopped."""
    from semslam.loop.segmentation.training.training import train
    from semslam.runs.files import writing

    chosen = options.settings(config, overrides, seed=seed)
    with writing(out_directory), bar("training", None, "steps") as update:

        def report(progress: "Progress") -> None:
            update(progress.step, progress.steps)

        weights = train(directory, chosen, out_directory, report)
    _report_weights(weights, directory, chosen)


def average_command(
    directory: Photos,
    weights: Annotated[list[Path], typer.Argument(help="Checkpoints of trainings that began alike.")],
    out_directory: Annotated[Path, typer.Option("--out", help="Folder of the mean's weights.")],
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
) -> None:
    """Average the weights of trained segmentation networks into one network."""
    from semslam.loop.segmentation.network.averaging import average
    from semslam.runs.files import writing

    chosen = options.settings(config, overrides)
    with writing(out_directory):
        mean = average(directory, weights, chosen, out_directory)
    _report_weights(mean, directory, chosen)


def _report_weights(weights: Path, directory: Path, config: "Config") -> None:
    from semslam.loop.segmentation.build import build_segmenter
    from semslam.loop.segmentation.training.evaluation import evaluate

    out.print(f"Weights: {weights}", soft_wrap=True)
    if (directory / "val.txt").exists():
        section = config.segmentation.model_copy(update={"name": "torch", "weights": weights})
        _print_score(evaluate(build_segmenter(config.with_changes(segmentation=section)), directory), "val.txt")


def evaluate_command(
    directory: Photos,
    split: Annotated[str, typer.Option(help="Name of the list of photos.")] = "val.txt",
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    depth: Annotated[bool, typer.Option("--depth/--no-depth", help="Use depth/NAME.png where there is one.")] = True,
    as_json: options.Json = False,
) -> None:
    """Score a segmenter on labelled photos, with their depth where there is any."""
    from semslam.loop.segmentation.build import build_segmenter
    from semslam.loop.segmentation.training.evaluation import evaluate

    segmenter = build_segmenter(options.settings(config, overrides))
    with bar(split, None, "photos") as update:
        score = evaluate(segmenter, directory, split, with_depth=depth, report=update)
    if as_json:
        typer.echo(json.dumps(asdict(score)))
    else:
        _print_score(score, split)


def _print_score(score: "SegmentationScore", split: str) -> None:
    table = Table(title=f"Segmentation on {split}", title_justify="left", show_header=False)
    table.add_row("mean IoU", f"{score.miou:.4f}")
    table.add_row("pixel accuracy", f"{score.pixel_accuracy:.4f}")
    table.add_row("mean class accuracy", f"{score.mean_class_accuracy:.4f}")
    table.add_row("median ms a photo", f"{score.ms:.1f}")
    for name, iou in sorted(score.per_class_iou.items(), key=lambda item: -(item[1] or 0.0)):
        table.add_row(f"  {name}", "-" if iou is None else f"{iou:.3f}")
    out.print(table)


def _image_names(path: str) -> "Iterator[str | int]":
    """Files of an image or a folder of images, else frame numbers of a sequence."""
    place = Path(path)
    if place.is_file() and place.suffix.lower() in IMAGES:
        yield path
        return
    inside = sorted(p for p in place.iterdir() if p.suffix.lower() in IMAGES) if place.is_dir() else []
    if inside:
        yield from map(str, inside)
        return
    from semslam.datasets import open_dataset

    yield from range(len(open_dataset(path)))


class _Image(NamedTuple):
    """An image to label: its file's name without ending, RGB (H, W, 3), and depth (H, W) in metres of a frame."""

    stem: str
    color: "UInt8Array"
    depth: "Float32Array | None" = None


def _images(path: str, names: "list[str | int]") -> "Iterator[_Image]":
    from semslam.datasets import open_dataset
    from semslam.datasets.images import read_color

    dataset = open_dataset(path) if names and isinstance(names[0], int) else None
    for name in names:
        if isinstance(name, str):
            yield _Image(Path(name).stem, read_color(Path(name)))
        elif dataset is not None:
            frame = dataset.frame(name)
            yield _Image(f"{name:06d}", frame.color, frame.depth)


def _write(path: Path, encoded: "UInt8Array") -> None:
    path.write_bytes(encoded.tobytes())


COMMANDS = (
    Command(
        "segment",
        segment_command,
        "Label images: an overlay with a legend and a label image for each.",
        example("semslam segment photo.jpg", "semslam segment DIR --every 10 --out labels"),
    ),
    Command(
        "train-segmenter",
        train_command,
        "Train the segmentation network on labelled photos; a killed training goes on where it stopped.",
        example("semslam train-segmenter nyuv2 --out training --set training.start=ade20k.pt"),
    ),
    Command(
        "average-segmenters",
        average_command,
        "Average the weights of trained segmentation networks into one network.",
        example("semslam average-segmenters nyuv2 A/weights.pt B/weights.pt --out mean"),
    ),
    Command(
        "eval-segmenter",
        evaluate_command,
        "Score a segmenter on labelled photos: mean IoU, pixel accuracy, mean class accuracy, IoU per class.",
        example("semslam eval-segmenter nyuv2 --split val.txt --json", "semslam eval-segmenter nyuv2 --no-depth"),
    ),
)
