"""How well each loop detector tells true loops from wrong places, and what is left after the verification.

    python benchmarks/detectors.py SEQUENCE... --detectors fused,dbow,conv3 --every 5

Prints two Markdown tables for each sequence: precision and recall over all pairs of keyframes, and how many queries
with a true past loop get a pose within 0.20 m and 10 degrees from the detector's few candidates.
"""

import argparse
import platform
from pathlib import Path

import numpy as np

from eval.loop_truth import find_loop_truth, make_view
from eval.trajectory import poses_at
from loop.verification import IcpVerifier
from semslam import plugins
from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.experiments import compare_detectors, keyframe_views
from semslam.geometry import invert, rotation_angle
from semslam.types import FloatArray, LoopConstraint

NAMES = "fused,semantic,semantic-paper,dbow,sda,cnnw,conv3,thumbnail,hog,gist"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", type=Path)
    parser.add_argument("--detectors", default=NAMES)
    parser.add_argument("--every", type=int, default=5, help="frames from one keyframe to the next")
    args = parser.parse_args()
    print(f"{platform.processor() or platform.machine()}, every {args.every}th frame a keyframe\n")
    for path in args.sequences:
        dataset = open_dataset(path)
        names = args.detectors.split(",")
        print_precision(dataset, names, args.every)
        print_verified(dataset, names, args.every)


def print_precision(dataset: Dataset, names: list[str], every: int) -> None:
    comparison = compare_detectors(dataset, Config(), names, every)
    first = comparison.qualities[0]
    print(f"{dataset.name}: {first.true_pairs} true, {first.false_pairs} false pairs\n")
    print("| detector | average precision | recall at 99 % | recall at 100 % | max F1 | recall@1 | ms a query |")
    print("|---|---|---|---|---|---|---|")
    for q in comparison.qualities:
        figures = (q.average_precision, q.recall_at_99_precision, q.recall_at_100_precision, q.max_f1, q.recall_at_1)
        print(f"| {q.detector} | " + " | ".join(f"{x:.3f}" for x in figures) + f" | {q.ms_per_query:.1f} |", flush=True)
    print()


def print_verified(dataset: Dataset, names: list[str], every: int) -> None:
    """Run each detector in earnest and verify what it proposes."""
    config = Config()
    assert dataset.ground_truth is not None
    views = list(keyframe_views(dataset, config, every, True))
    stamps = [view.keyframe.timestamp for view in views]
    truth = find_loop_truth(stamps, [make_view(v.depth, v.keyframe.intrinsics) for v in views], dataset.ground_truth)
    poses, _ = poses_at(dataset.ground_truth, stamps)
    verifier = IcpVerifier.from_config(config)
    print("| detector | proposed | accepted | pose off | wrong place | queries closed |")
    print("|---|---|---|---|---|---|")
    for name in names:
        detector = plugins.load("semslam.detectors", name).from_config(config)
        proposed, accepted, off, wrong, closed = 0, 0, 0, 0, np.zeros(len(views), dtype=bool)
        for row, view in enumerate(views):
            for candidate in detector.query(view):
                proposed += 1
                outcome = verifier.verify(view.keyframe, views[candidate.match].keyframe, candidate)
                if isinstance(outcome, LoopConstraint):
                    good = is_accurate(outcome, poses, row)
                    accepted, off, closed[row] = accepted + 1, off + (not good), closed[row] | good
                    wrong += not good and bool(truth.false_pairs[row, candidate.match])
            detector.add(view)
        true = truth.true_pairs.any(axis=1)
        share = f"{(closed & true).sum()} of {true.sum()}"
        print(f"| {name} | {proposed} | {accepted} | {off} | {wrong} | {share} |", flush=True)
    print()


def is_accurate(loop: LoopConstraint, poses: FloatArray, row: int) -> bool:
    error = invert(invert(poses[loop.candidate.match]) @ poses[row]) @ loop.T_match_query
    return bool(np.linalg.norm(error[:3, 3]) <= 0.20 and rotation_angle(error) <= np.radians(10))


if __name__ == "__main__":
    main()
