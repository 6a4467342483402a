"""How well each loop detector separates true loops from wrong places, in other light too, and what verification leaves.

    python benchmarks/detectors.py SEQUENCE... --detectors fused,dbow,conv3 --parts precision,calibration

Prints Markdown tables. Parts:

- precision: precision and recall over all pairs of keyframes that view overlap decides;
- calibration: of the probability that "fused" gives, against the share of true pairs;
- changes: a keyframe under other light or without an object against its neighbours, at the threshold that 1 % of the
  unchanged wrong pairs reach;
- verified: how many queries with a true past loop get a pose within 0.20 m and 10 degrees from the few candidates;
- mixed: the same candidates with the keyframes of all sequences in one database; a loop across is a wrong place;
- speed: processor time of a query with 200, 1000 and 5000 keyframes, on the first sequence.
"""

import argparse
import platform
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from time import process_time

import numpy as np

from semslam import plugins
from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.eval.loops.reliability import calibration_error
from semslam.eval.loops.truth import TRUE_OVERLAP, find_loop_truth, make_view
from semslam.eval.pairs.changes import Change, change_frame
from semslam.eval.trajectory import BoolArray, poses_at
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.geometry.se3 import invert, rotation_angle
from semslam.loop.detector import LoopDetector
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.verification.icp import IcpVerifier
from semslam.loop.verification.submaps import ends_of
from semslam.runtime.threads import one_blas_thread
from semslam.studies.detectors import compare_detectors, exhaustive_detector, keyframe_views
from semslam.types import Frame, KeyframeView, LoopConstraint, Transforms

NAMES = (
    "fused,semantic,semantic-paper,dbow,sda,cnnw,conv3,placecnn,pcanet,topology,subgraph,static-cnn,tnnlost,"
    "thumbnail,hog,gist"
)
PARTS = "precision,calibration,changes,verified,mixed,speed"
LATER = 1000.0
"""Seconds between one sequence and the next in a common database, or between a sequence and a changed query."""
SIZES = (200, 1000, 5000)
LATER_ID = 9999
CHANGED_STEP = 3
"""Every third keyframe is changed."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+")
    parser.add_argument("--detectors", default=NAMES)
    parser.add_argument("--parts", default=PARTS)
    parser.add_argument("--every", type=int, default=5, help="frames from one keyframe to the next")
    args = parser.parse_args()
    parts, names = args.parts.split(","), args.detectors.split(",")
    print(f"{platform.processor() or platform.machine()}, every {args.every}th frame a keyframe\n")
    datasets = [open_dataset(path) for path in args.sequences]
    for dataset in datasets:
        if {"precision", "calibration"} & set(parts):
            print_precision(dataset, names, args.every, "calibration" in parts)
        if "changes" in parts:
            print_changes(dataset, names, args.every)
        if "verified" in parts:
            print_verified(dataset, names, args.every)
    if "mixed" in parts:
        print_mixed(datasets, names, args.every)
    if "speed" in parts:
        print_speed(datasets[0], names, args.every)


def print_precision(dataset: Dataset, names: list[str], every: int, calibration: bool) -> None:
    comparison = compare_detectors(dataset, Config(), names, every)
    first = comparison.qualities[0]
    print(f"{dataset.name}: {first.true_pairs} true, {first.false_pairs} false pairs\n")
    print("| detector | average precision | recall at 99 % | recall at 100 % | max F1 | recall@1 | ms a query |")
    print("|---|---|---|---|---|---|---|")
    for q in comparison.qualities:
        figures = (q.average_precision, q.recall_at_99_precision, q.recall_at_100_precision, q.max_f1, q.recall_at_1)
        print(f"| {q.detector} | " + " | ".join(f"{x:.3f}" for x in figures) + f" | {q.ms_per_query:.1f} |", flush=True)
    print()
    for name, source in comparison.features_from.items():
        print(f"`{name}`: features of {source}\n")
    if calibration and "fused" in names:
        bins = comparison.reliabilities["fused"]
        print("| probability by `fused` | pairs | mean probability | share true |\n|---|---|---|---|")
        for part in bins:
            print(
                f"| {part.low:.1f} to {part.high:.1f} | {part.pairs} | {part.mean_score:.2f} | {part.share_true:.2f} |"
            )
        print(f"\nCalibration error {calibration_error(bins):.3f}")
        print()


def print_changes(dataset: Dataset, names: list[str], every: int) -> None:
    """Acceptance of changed keyframes against their unchanged neighbours."""
    config = Config()
    views = list(keyframe_views(dataset, config, every, True))
    detectors = {name: exhaustive_detector(name, config, len(views)) for name in names}
    for view in views:
        for detector in detectors.values():
            detector.add(view)
    wrong, near = wrong_and_near(dataset, views, config.loops.min_gap)
    if not wrong[::CHANGED_STEP].any():
        print(f"{dataset.name}: no wrong pairs to hold the changed keyframes against\n")
        return
    unchanged: dict[str, list[float]] = {name: [] for name in names}
    beside: dict[tuple[str, Change], list[float]] = {}
    for row, change, query in changed_views(views, config):
        for name, detector in detectors.items():
            scores = np.zeros(len(views))
            for candidate in detector.query(query):
                scores[candidate.match] = candidate.score
            if change is Change.NONE:
                unchanged[name] += scores[wrong[row]].tolist()
            else:
                beside.setdefault((name, change), []).extend(scores[near[row]].tolist())
    changes = [change for change in Change if change is not Change.NONE]
    print(f"{dataset.name}: share accepted at 1 % of the wrong pairs\n")
    print("| detector | " + " | ".join(changes) + " |\n|---|" + "---|" * len(changes))
    for name in names:
        limit = np.quantile(unchanged[name], 0.99)
        shares = [float(np.mean(np.array(beside.get((name, change), [np.nan])) > limit)) for change in changes]
        print(f"| {name} | " + " | ".join(f"{share:.3f}" for share in shares) + " |", flush=True)
    print()


def wrong_and_near(dataset: Dataset, views: list[KeyframeView], min_gap: float) -> tuple[BoolArray, BoolArray]:
    """(N, N) which views, long apart, show different places, and which stand next to one another and see the same."""
    assert dataset.ground_truth is not None
    depths = [make_view(view.depth, view.keyframe.intrinsics) for view in views]
    truth = find_loop_truth([v.keyframe.timestamp for v in views], depths, dataset.ground_truth, min_gap=0.0)
    wrong = replace(truth, min_gap=min_gap).false_pairs
    rows = np.arange(len(views))
    beside = np.abs(rows[:, None] - rows) == 1
    return wrong | wrong.T, beside & (np.minimum(truth.overlap, truth.overlap.T) >= TRUE_OVERLAP)


def changed_views(views: list[KeyframeView], config: Config) -> Iterator[tuple[int, Change, KeyframeView]]:
    """Every third view, unchanged and with each change that it can show, asked for long after the last one."""
    segmenter, builder = build_segmenter(config), KeyframeBuilder(config, details=False)
    for row in range(0, len(views), CHANGED_STEP):
        old = views[row]
        frame = Frame(row, old.keyframe.timestamp + LATER, old.color, old.depth, old.keyframe.intrinsics)
        for change in Change:
            changed = change_frame(frame, change, row)
            if change is Change.NONE or changed is not frame:
                keyframe = replace(builder.build_at(changed, old.keyframe.T_odom_cam), id=len(views))
                labels = segmenter.segment(changed.color, changed.depth)
                yield row, change, KeyframeView(keyframe, changed.color, changed.depth, labels)


def print_mixed(datasets: list[Dataset], names: list[str], every: int) -> None:
    """All sequences in one database, each long after the one before; loops across are wrong places."""
    config = Config()
    views: list[KeyframeView] = []
    origin: list[int] = []
    for number, dataset in enumerate(datasets):
        for view in keyframe_views(dataset, config, every, True):
            stamp = view.keyframe.timestamp - dataset.timestamps[0] + LATER * number
            keyframe = replace(view.keyframe, id=len(views), timestamp=stamp)
            views.append(replace(view, keyframe=keyframe))
            origin.append(number)
    verifier, keyframes = IcpVerifier.from_config(config), [view.keyframe for view in views]
    print(f"{', '.join(d.name for d in datasets)} in one database\n")
    print("| detector | proposed across | accepted across |\n|---|---|---|")
    for name in names:
        detector = plugins.load("semslam.detectors", name).from_config(config)
        proposed, accepted = 0, 0
        for row, view in enumerate(views):
            for candidate in detector.query(view):
                if origin[candidate.match] != origin[row]:
                    proposed += 1
                    outcome = verifier.verify(*ends_of(candidate, keyframes), candidate)
                    accepted += isinstance(outcome, LoopConstraint)
            detector.add(view)
        print(f"| {name} | {proposed} | {accepted} |", flush=True)
    print()


def print_speed(dataset: Dataset, names: list[str], every: int) -> None:
    """Processor milliseconds of a query against databases of real keyframes that are entered repeatedly."""
    views = list(islice(keyframe_views(dataset, Config(), every, True), 100))
    print("Milliseconds a query (median, processor time), description included, segmentation not\n")
    print(f"| detector | {' | '.join(f'{size} keyframes' for size in SIZES)} |\n|---{'|---' * len(SIZES)}|")
    for name in names:
        detector = plugins.load("semslam.detectors", name).from_config(Config())
        medians = []
        for number in range(max(SIZES)):
            view = views[number % len(views)]
            keyframe = replace(view.keyframe, id=number, timestamp=float(number))
            detector.add(replace(view, keyframe=keyframe))
            if number + 1 in SIZES:
                medians.append(f"{query_time(detector, views[:40]):.1f}")
        print(f"| {name} | {' | '.join(medians)} |", flush=True)


def query_time(detector: LoopDetector, views: list[KeyframeView]) -> float:
    """Median processor milliseconds of a query, each view taken for one long after all."""
    spent = []
    for view in views:
        query = replace(view, keyframe=replace(view.keyframe, id=LATER_ID, timestamp=float(LATER_ID)))
        start = process_time()
        with one_blas_thread():
            detector.query(query)
        spent.append(1000 * (process_time() - start))
    return float(np.median(spent))


def print_verified(dataset: Dataset, names: list[str], every: int) -> None:
    """Run each detector in earnest and verify what it proposes."""
    config = Config()
    assert dataset.ground_truth is not None
    views = list(keyframe_views(dataset, config, every, True))
    stamps = [view.keyframe.timestamp for view in views]
    truth = find_loop_truth(stamps, [make_view(v.depth, v.keyframe.intrinsics) for v in views], dataset.ground_truth)
    poses, _ = poses_at(dataset.ground_truth, stamps)
    verifier, keyframes = IcpVerifier.from_config(config), [view.keyframe for view in views]
    print(f"{dataset.name}: after verification\n")
    print("| detector | proposed | accepted | pose off | wrong place | queries closed |")
    print("|---|---|---|---|---|---|")
    for name in names:
        detector = plugins.load("semslam.detectors", name).from_config(config)
        proposed, accepted, off, wrong, closed = 0, 0, 0, 0, np.zeros(len(views), dtype=bool)
        for row, view in enumerate(views):
            for candidate in detector.query(view):
                proposed += 1
                outcome = verifier.verify(*ends_of(candidate, keyframes), candidate)
                if isinstance(outcome, LoopConstraint):
                    good = is_accurate(outcome, poses)
                    accepted, off, closed[row] = accepted + 1, off + (not good), closed[row] | good
                    wrong += not good and bool(truth.false_pairs[row, candidate.match])
            detector.add(view)
        true = truth.true_pairs.any(axis=1)
        share = f"{(closed & true).sum()} of {true.sum()}"
        print(f"| {name} | {proposed} | {accepted} | {off} | {wrong} | {share} |", flush=True)
    print()


def is_accurate(loop: LoopConstraint, poses: Transforms) -> bool:
    error = invert(invert(poses[loop.match]) @ poses[loop.query]) @ loop.T_match_query
    return bool(np.linalg.norm(error[:3, 3]) <= 0.20 and rotation_angle(error) <= np.radians(10))


if __name__ == "__main__":
    main()
