"""Segmentation: accuracy against time, and how steady labels are from frame to frame.

    python benchmarks/segmentation.py speed  --data ../shared/data/nyuv2
    python benchmarks/segmentation.py teachers --data ../shared/data/nyuv2 --teachers A/weights.pt B/weights.pt
    python benchmarks/segmentation.py steady --sequence ../shared/data/redkitchen

Prints rows of Markdown tables. Times are medians of the processor's time for one photo of the input's size, decoding
included.
"""

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import torch

from semslam.config import load_config, parse_overrides
from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.geometry.se3 import invert, transform_points
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.segmentation.classes import CLASS_COUNT, GROUP_OF_LABEL
from semslam.loop.segmentation.decoding import shrink
from semslam.loop.segmentation.network.checkpoint import load_network
from semslam.loop.segmentation.network.export import float_graph
from semslam.loop.segmentation.network.network import build_mobilenet_deeplab, count_multiply_adds, count_parameters
from semslam.loop.segmentation.network.xception import build_xception_deeplab
from semslam.loop.segmentation.photos import UInt8Array, list_names, read_photo
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.loop.segmentation.segmenters.onnx import OnnxSegmenter, load_graph
from semslam.loop.segmentation.shipped import CHECKPOINT
from semslam.loop.segmentation.training.evaluation import confusion_matrix, evaluate, score
from semslam.loop.segmentation.training.self_training import Teacher
from semslam.types import Frame, LabelMap

SIZES = ((320, 240), (448, 336), (640, 480))
WAYS = (("onnx", "int8"), ("onnx", "float32"), ("torch", "float32"))
DEPTH_TOLERANCE = 0.05


def median_ms(segmenters: Sequence[Segmenter], photo: UInt8Array, rounds: int) -> list[float]:
    """Median milliseconds of processor time of each, all taking turns so that a busy machine slows all alike."""
    times = np.zeros((rounds + 1, len(segmenters)))
    for turn in times:
        for i, segmenter in enumerate(segmenters):
            start = time.process_time()
            segmenter.segment(photo)
            turn[i] = time.process_time() - start
    medians: list[float] = (1e3 * np.median(times[1:], axis=0)).tolist()  # the first round warms up
    return medians


def speed_table(data: Path, rounds: int, threads: int) -> None:
    """Accuracy and time of each way and size."""
    torch.set_num_threads(threads)
    photo = read_photo(data, list_names(data, "val.txt")[0]).color
    graph = float_graph(build_xception_deeplab())
    print("| network | way | input | mIoU | pixel accuracy | ms |\n|---|---|---|---|---|---|")
    for size in SIZES:
        ways = [way_of(name, precision, size, threads) for name, precision in WAYS]
        given = shrink(photo, size)
        *times, xception = median_ms([*ways, OnnxSegmenter(graph, size, threads)], given, rounds)
        for (name, precision), segmenter, ms in zip(WAYS, ways, times, strict=True):
            # PyTorch gives ONNX float32's labels (a test sees to it), so it is not scored again.
            result = evaluate(segmenter, data, size=None if size == SIZES[-1] else size) if name == "onnx" else None
            marks = f"{result.miou:.3f} | {result.pixel_accuracy:.3f}" if result else "as above | as above"
            print(f"| MobileNetV2 | {name} {precision} | {size[0]}x{size[1]} | {marks} | {ms:.1f} |", flush=True)
        print(f"| Xception-65 | onnx float32 | {size[0]}x{size[1]} | untrained | untrained | {xception:.1f} |")


def way_of(name: str, precision: str, size: tuple[int, int], threads: int) -> Segmenter:
    """The shipped network by one inference engine."""
    settings = {"name": name, "precision": precision, "width": size[0], "height": size[1], "threads": threads}
    return build_segmenter(load_config(overrides={"segmentation": settings}))


def teachers_table(data: Path, weights: Sequence[Path]) -> None:
    """What networks score together, as teachers: at two sizes and mirrored, each alone and the first n averaged."""
    teachers = [Teacher([load_graph(path, "float32")]) for path in weights]
    groups = [*({i} for i in range(len(weights))), *(set(range(n)) for n in range(2, len(weights) + 1))]
    confusions = np.zeros((len(groups), CLASS_COUNT + 1, CLASS_COUNT + 1), dtype=np.int64)
    for name in list_names(data, "val.txt"):
        photo = read_photo(data, name)
        truth = cv2.resize(photo.labels, SIZES[0], interpolation=cv2.INTER_NEAREST).astype(np.uint8)
        beliefs = [teacher.probabilities(photo.color) for teacher in teachers]
        for i, group in enumerate(groups):
            mean = np.mean([beliefs[member] for member in group], axis=0)
            labels = cv2.resize(mean, SIZES[0]).argmax(axis=2).astype(np.uint8) + np.uint8(1)
            confusions[i] += confusion_matrix(truth, labels)
    print("| teachers | mIoU | pixel accuracy |\n|---|---|---|")
    for confusion, group in zip(confusions, groups, strict=True):
        result = score(confusion)
        members = ", ".join(str(weights[i]) for i in sorted(group))
        print(f"| {members} | {result.miou:.4f} | {result.pixel_accuracy:.4f} |")


def size_table() -> None:
    """Parameters and multiply-adds of the shipped network and of both backbones with the same decoder."""
    print("| network | decoder's channels | parameters | multiply-adds at 320x240 |\n|---|---|---|---|")
    networks = {
        "MobileNetV2, shipped": load_network(CHECKPOINT),
        "MobileNetV2": build_mobilenet_deeplab(),
        "Xception-65": build_xception_deeplab(),
    }
    for name, network in networks.items():
        size = f"{count_parameters(network) / 1e6:.2f} M | {count_multiply_adds(network, 240, 320) / 1e9:.2f} G"
        print(f"| {name} | {network.decoder_channels} | {size} |")


def steady_table(sequence: Path, gap: int, stride: int, segmenters: dict[str, Segmenter]) -> None:
    """Share of scene points with the same label ``gap`` frames on, and overlap of the two frames' label sets."""
    dataset = open_dataset(sequence)
    print("| sequence | segmenter | labels that agree | groups that agree | label sets |\n|---|---|---|---|---|")
    for name, segmenter in segmenters.items():
        rows = []
        for i in range(0, len(dataset) - gap, stride):
            pair = dataset.frame(i), dataset.frame(i + gap)
            first, second = (segmenter.segment(frame.color, frame.depth, frame.source_index) for frame in pair)
            motion = true_motion(dataset, *pair)
            if motion is not None:
                rows.append((*agreement(pair[0], pair[1], first, second, motion), set_overlap(first, second)))
        labels, groups, sets = np.nanmean(rows, axis=0)
        print(f"| {dataset.name} | {name} | {labels:.3f} | {groups:.3f} | {sets:.3f} |", flush=True)


def true_motion(dataset: Dataset, first: Frame, second: Frame) -> np.ndarray | None:
    """T_second_first by the ground truth's nearest stamps, or None where it has none within 20 ms."""
    truth = dataset.ground_truth
    if truth is None:
        return None
    nearest = [int(np.abs(truth.timestamps - frame.timestamp).argmin()) for frame in (first, second)]
    offsets = [abs(truth.timestamps[n] - f.timestamp) for n, f in zip(nearest, (first, second), strict=True)]
    return invert(truth.poses[nearest[1]]) @ truth.poses[nearest[0]] if max(offsets) < 0.02 else None


def agreement(
    first: Frame, second: Frame, a: LabelMap, b: LabelMap, T_second_first: np.ndarray, step: int = 4
) -> tuple[float, float]:
    """Share of the points seen in both frames whose labels (and groups of labels) agree."""
    camera = first.intrinsics
    seen = first.depth[::step, ::step] > 0
    points = transform_points(T_second_first, camera.back_project(first.depth, step))
    labels = a.labels[::step, ::step][seen]
    front = points[:, 2] > 0.1
    points, labels = points[front], labels[front]
    u, v = np.round(distort(second, points)).astype(int).T
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    u, v, z, labels = u[inside], v[inside], points[inside, 2], labels[inside]
    visible = np.abs(second.depth[v, u] - z) < DEPTH_TOLERANCE * z
    if not visible.any():
        return float("nan"), float("nan")
    there, here = b.labels[v, u][visible], labels[visible]
    return float((there == here).mean()), float((GROUP_OF_LABEL[there] == GROUP_OF_LABEL[here]).mean())


def distort(frame: Frame, points: np.ndarray) -> np.ndarray:
    """Raw pixels (N, 2) of camera-frame points (N, 3)."""
    camera = frame.intrinsics
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion))
    return np.clip(pixels.reshape(-1, 2), -1e6, 1e6)


def set_overlap(a: LabelMap, b: LabelMap, share: float = 0.01) -> float:
    """Labels in both over labels in either, among those on at least ``share`` of the image."""
    sets = [set(np.flatnonzero(np.bincount(m.labels.ravel()) >= share * m.labels.size)) for m in (a, b)]
    return len(sets[0] & sets[1]) / max(1, len(sets[0] | sets[1]))


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=["speed", "size", "teachers", "steady"])
    parser.add_argument("--data", type=Path, default=Path("../shared/data/nyuv2"))
    parser.add_argument("--sequence", type=Path, default=Path("../shared/data/redkitchen"))
    parser.add_argument("--set", action="append", default=[], help="a setting for the table 'steady', KEY=VALUE")
    parser.add_argument("--teachers", type=Path, nargs="+", default=[], help="weights for the table 'teachers'")
    parser.add_argument("--gap", type=int, default=5)
    parser.add_argument("--stride", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=22)
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    cv2.setNumThreads(arguments.threads)
    if arguments.table == "speed":
        speed_table(arguments.data, arguments.rounds, arguments.threads)
    elif arguments.table == "size":
        size_table()
    elif arguments.table == "teachers":
        teachers_table(arguments.data, arguments.teachers)
    else:
        segmenters = {"onnx": build_segmenter(load_config(overrides=parse_overrides(arguments.set)))}
        steady_table(arguments.sequence, arguments.gap, arguments.stride, segmenters)


if __name__ == "__main__":
    main()
