"""Measure the verification on posed sequences: poses found, wrong places accepted, covariances against the truth.

    python benchmarks/verification.py SEQ... [--every 5] [--detector fused] [--icp colored] [--neighbours] [--kinds 4]

All sequences go into one database, one after the other; the detector proposes across them. Printed for each sequence:
queries that have a true past loop and the share of them that gets a pose within 0.2 m and 10 degrees, loops verified,
those with a pose that is off, those of a wrong place, pose errors, and the mean and percentiles of the normalised
squared error (six degrees of freedom, so 6 is exact). With ``--neighbours`` also how far each loop lies from the
nearest one between neighbours of its keyframes, were the odometry between them exact. With ``--kinds N`` every N-th
verified pair is verified again with each kind of ICP, in turns: how many stay verified, their pose errors, and
processor time.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from semslam import plugins
from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.eval.loops.truth import ANGLE_TOLERANCE, POSE_TOLERANCE, LoopTruth, find_loop_truth, make_view
from semslam.eval.nees import nees
from semslam.eval.trajectory import poses_at
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.geometry.se3 import FloatArray, Transforms, invert, rotation_angle
from semslam.loop.detector import LoopDetector
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.verification.icp import IcpVerifier
from semslam.loop.verification.registration import ICP_KINDS
from semslam.loop.verification.submaps import ends_of
from semslam.types import Keyframe, KeyframeView, LoopConstraint

PAUSE = 1000.0
"""Seconds put between two sequences."""
NEIGHBOURS = 2
"""Keyframes by which the ends of a neighbouring loop may lie apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A sequence's keyframes in the common database: ids from ``first``, true poses, true and false pairs."""

    name: str
    first: int
    poses: Transforms
    truth: LoopTruth
    loops: list[LoopConstraint]


def keyframes(path: str, every: int, config: Config, first: int, start: float) -> Iterator[KeyframeView]:
    """Every n-th frame with its images, labels and true pose, numbered from ``first``, ``start`` seconds later."""
    dataset, segmenter = open_dataset(path), build_segmenter(config)
    assert dataset.ground_truth is not None, f"{path} has no ground truth."
    poses, _ = poses_at(dataset.ground_truth, dataset.timestamps[::every])
    builder = KeyframeBuilder(config)
    for number, index in enumerate(range(0, len(dataset), every)):
        frame = dataset.frame(index)
        keyframe = builder.build_at(frame, invert(poses[0]) @ poses[number])  # detectors turn images upright by it
        labels = segmenter.segment(frame.color, frame.depth, frame.source_index)
        later = replace(keyframe, id=first + number, timestamp=keyframe.timestamp + start)
        yield KeyframeView(later, frame.color, frame.depth, labels)


def run(path: str, every: int, config: Config, detector: LoopDetector, known: list[Keyframe]) -> Part:
    """Query, verify and add each keyframe of a sequence; ``known`` grows."""
    dataset = open_dataset(path)
    assert dataset.ground_truth is not None, f"{path} has no ground truth."
    verifier, first = IcpVerifier.from_config(config), len(known)
    start = 0.0 if not known else known[-1].timestamp + PAUSE - dataset.timestamps[0]
    loops, depths, spent, tried = [], [], 0.0, 0
    for view in keyframes(path, every, config, first, start):
        candidates = detector.query(view)
        detector.add(view)
        known.append(view.keyframe)
        depths.append(make_view(view.depth, view.keyframe.intrinsics))
        before = time.process_time()
        outcomes = [verifier.verify(*ends_of(c, known), c) for c in candidates]
        spent, tried = spent + time.process_time() - before, tried + len(outcomes)
        loops += [outcome for outcome in outcomes if isinstance(outcome, LoopConstraint)]
    stamps = np.array([keyframe.timestamp - start for keyframe in known[first:]])
    poses, _ = poses_at(dataset.ground_truth, stamps)
    print(f"{dataset.name}: {tried} candidates, {1e3 * spent / max(tried, 1):.0f} CPU ms each", flush=True)
    return Part(dataset.name, first, poses, find_loop_truth(stamps, depths, dataset.ground_truth), loops)


def report(part: Part) -> None:
    """Print a sequence's figures."""
    elsewhere = [loop for loop in part.loops if loop.match < part.first]
    here = [loop for loop in part.loops if loop.match >= part.first]
    errors, good, wrong = [], set(), len(elsewhere)
    squared = nees(
        np.array([error_of(part, loop) for loop in here]).reshape(-1, 4, 4),
        np.array([loop.covariance for loop in here]).reshape(-1, 6, 6),
    )
    for loop in here:
        query, match = loop.query - part.first, loop.match - part.first
        E = error_of(part, loop)
        errors.append((float(np.linalg.norm(E[:3, 3])), float(np.degrees(rotation_angle(E)))))
        if errors[-1][0] <= POSE_TOLERANCE and errors[-1][1] <= ANGLE_TOLERANCE:
            good.add(loop.candidate.query - part.first)
        else:
            wrong += bool(part.truth.false_pairs[query, match])
    asked = set(np.flatnonzero(part.truth.true_pairs.any(1)).tolist())
    off = sum(metres > POSE_TOLERANCE or degrees > ANGLE_TOLERANCE for metres, degrees in errors)
    print(
        f"{part.name}: {len(asked)} queries, share with a pose {len(good & asked) / max(len(asked), 1):.3f};"
        f" {len(part.loops)} verified, {off} off, {wrong} of a wrong place"
    )
    if errors:
        metres, degrees = np.array(errors).T
        print(f"  cm 50/95/100 % {(100 * np.percentile(metres, [50, 95, 100])).round(1)}", end="")
        print(f"  degrees {np.percentile(degrees, [50, 95, 100]).round(2)}", end="")
        print(f"  NEES mean {np.mean(squared):.1f}, 50/90/99 % {np.percentile(squared, [50, 90, 99]).round(1)}")


def compare_kinds(part: Part, known: list[Keyframe], every: int) -> None:
    """Print what each kind of ICP makes of every n-th verified pair of a sequence."""
    pairs = [loop.candidate for loop in part.loops if loop.candidate.match >= part.first][::every]
    verifiers = {k: IcpVerifier.from_config(Config().with_changes(verification={"icp": k})) for k in ICP_KINDS}
    errors: dict[str, list[tuple[float, float]]] = {kind: [] for kind in ICP_KINDS}
    spent: dict[str, list[float]] = {kind: [] for kind in ICP_KINDS}
    for candidate in pairs:
        for kind, verifier in verifiers.items():
            before = time.process_time()
            loop = verifier.verify(*ends_of(candidate, known), candidate)
            spent[kind].append(1e3 * (time.process_time() - before))
            if isinstance(loop, LoopConstraint):
                E = error_of(part, loop)
                errors[kind].append((100 * float(np.linalg.norm(E[:3, 3])), float(np.degrees(rotation_angle(E)))))
    for kind in ICP_KINDS:
        middle, late = np.percentile(errors[kind], [50, 95], axis=0)
        print(
            f"| {part.name} | {kind} | {len(errors[kind])} of {len(pairs)} | {middle[0]:.1f} / {late[0]:.1f} |"
            f" {middle[1]:.2f} / {late[1]:.2f} | {np.median(spent[kind]):.0f} |"
        )


def ask_neighbours(part: Part) -> None:
    """Print how far loops lie from the nearest loop of neighbouring keyframes, by exact odometry between them."""
    here = [loop for loop in part.loops if loop.match >= part.first]
    ends = np.array([(loop.query, loop.match) for loop in here]) - part.first
    gaps: dict[str, list[float]] = {"right": [], "off": [], "of a wrong place": []}
    alone = dict.fromkeys(gaps, 0)
    for loop, (query, match) in zip(here, ends, strict=True):
        E = error_of(part, loop)
        kind = "right" if np.linalg.norm(E[:3, 3]) <= POSE_TOLERANCE else "off"
        kind = "of a wrong place" if part.truth.false_pairs[query, match] else kind
        near = np.abs(ends - (query, match)).max(1)
        beside = np.flatnonzero((near > 0) & (near <= NEIGHBOURS)).tolist()
        alone[kind] += not beside
        estimated = [
            part.poses[ends[i, 1]] @ here[i].T_match_query @ invert(part.poses[ends[i, 0]]) @ part.poses[query]
            for i in beside
        ]
        away = [np.linalg.norm((invert(part.poses[match] @ loop.T_match_query) @ T)[:3, 3]) for T in estimated]
        gaps[kind] += [100 * float(min(away))] if away else []
    for kind, distances in gaps.items():
        spread = np.percentile(distances, [50, 90, 99]).round(1) if distances else "-"
        print(f"  {kind}: {len(distances)} with a neighbour, {alone[kind]} alone; cm 50/90/99 % {spread}")


def error_of(part: Part, loop: LoopConstraint) -> FloatArray:
    """Motion (4, 4) from the true pose of a sequence's loop to the verified one."""
    query, match = loop.query - part.first, loop.match - part.first
    return invert(invert(part.poses[match]) @ part.poses[query]) @ loop.T_match_query


def main() -> None:
    """Measure all sequences in one database."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+")
    parser.add_argument("--every", type=int, default=5)
    parser.add_argument("--detector", default="fused")
    parser.add_argument("--icp", default="point_to_plane")
    parser.add_argument("--neighbours", action="store_true", help="how far loops lie from their neighbours' loops")
    parser.add_argument("--kinds", type=int, default=0, help="compare kinds of ICP on every n-th verified pair")
    arguments = parser.parse_args()
    config = Config().with_changes(verification={"icp": arguments.icp})
    detector = plugins.load("semslam.detectors", arguments.detector).from_config(config)
    known: list[Keyframe] = []
    for path in arguments.sequences:
        part = run(path, arguments.every, config, detector, known)
        report(part)
        if arguments.neighbours:
            ask_neighbours(part)
        if arguments.kinds:
            compare_kinds(part, known, arguments.kinds)


if __name__ == "__main__":
    main()
