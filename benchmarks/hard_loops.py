"""Loops where appearance fails: places seen again from another side, in other light, after things were moved.

    python benchmarks/hard_loops.py "synthetic:house?way=back&rate=5" --every 3 [--detectors objects,fused] [--labels]

Frames are tracked by the default odometry. A revisit is a keyframe whose place, one room with a common surface of the
surroundings, was seen at least 15 s before (``semslam.eval.loops.places``); its kind is the angle between its optical
axis and that of the earlier keyframe of the place whose camera stood nearest: same direction below 45 degrees, opposite
above 120. Printed for each detector and kind:

- ranked: share of revisits with a proposed candidate of their place that scores above every proposed candidate of a
  different place: recall without a false proposal;
- closed: share of revisits with a verified loop over at least 15 s whose pose is within 0.20 m and 10 degrees; ``off``
  counts those of all ``verified`` loops that miss this, ``false`` those by over 0.5 m or 20 degrees.

With ``--crowd N`` the scene's keyframes are first entered repeatedly until the database holds N, and only what a
detector keeps of each and the processor time of a query, description included and segmentation not, are printed.
With ``--labels`` the scene's exact labels take the network's place. ``--set`` changes settings, as of an ablation.
"""

import argparse
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from semslam import plugins
from semslam.config import Config, parse_overrides
from semslam.datasets import open_dataset
from semslam.datasets.synthetic import SyntheticDataset
from semslam.eval.loops.places import PlaceTruth, Revisit, find_places, is_revisit
from semslam.eval.loops.truth import ANGLE_TOLERANCE, POSE_TOLERANCE
from semslam.eval.trajectory import poses_at
from semslam.geometry.se3 import invert, rotation_angle
from semslam.loop.detector import Remembering
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.loop.verification.submaps import ends_of
from semslam.loop.verification.verifier import build_verifier
from semslam.runtime.threads import one_blas_thread
from semslam.studies.detectors import keyframe_views
from semslam.types import FloatArray, KeyframeView, LabelMap, LoopConstraint

NAMES = "objects,fused,semantic,dbow,sda,cnnw,conv3,thumbnail,hog,gist"
FALSE_METRES, FALSE_DEGREES = 0.5, 20.0
"""Beyond either a verified loop is false."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A sequence's keyframes, their true poses (N, 4, 4) and places."""

    name: str
    views: list[KeyframeView]
    poses: FloatArray
    truth: PlaceTruth


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """What became of a detector's candidates.

    Attributes:
        ranked: (N,) score of each query's best candidate of its place, 0 = none.
        bar: the highest score of a candidate of a different place.
        closed: (N,) whether a verified loop of each query to an earlier visit has the right pose.
        verified, off, false: verified loops, those whose pose is off, those by much.
    """

    ranked: FloatArray
    bar: float
    closed: FloatArray
    verified: int
    off: int
    false: int


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+", help="rendered scenes")
    parser.add_argument("--detectors", default=NAMES)
    parser.add_argument("--every", type=int, default=5, help="frames from one keyframe to the next")
    parser.add_argument("--crowd", type=int, default=0, help="keyframes in the database before the first query")
    parser.add_argument("--labels", action="store_true", help="exact labels")
    parser.add_argument("--set", action="append", default=[], help="a setting, KEY=VALUE")
    args = parser.parse_args()
    config = Config().with_changes(**parse_overrides(args.set))
    for path in args.sequences:
        scene = read_scene(path, config, args.every, args.labels)
        if args.crowd:
            for name in args.detectors.split(","):
                print(cost_of(name, scene, config, args.crowd), flush=True)
            continue
        counts = {kind: len(scene.truth.queries(kind)) for kind in Revisit}
        print(f"{path}: {len(scene.views)} keyframes, revisits: " + ", ".join(f"{n} {k}" for k, n in counts.items()))
        kinds = " | ".join(f"{what} {kind}" for what in ("ranked", "closed") for kind in Revisit)
        print(f"\n| detector | {kinds} | verified | off | false |\n|---|" + "---|" * (2 * len(Revisit) + 3))
        for name in args.detectors.split(","):
            print(row(name, scene, ask(name, scene, config)), flush=True)
        print(flush=True)


def read_scene(path: str, config: Config, every: int, exact_labels: bool) -> Scene:
    """Track a rendered sequence and label its keyframes."""
    dataset = open_dataset(path)
    assert isinstance(dataset, SyntheticDataset), f"{path} is no rendered scene."
    views = []
    for view in keyframe_views(dataset, config, every, needs_labels=not exact_labels):
        if exact_labels:
            labels = LabelMap(dataset.labels(view.keyframe.frame_index), NYU40_NAMES)
            views.append(replace(view, labels=labels))
        else:
            views.append(view)
    stamps = [view.keyframe.timestamp for view in views]
    poses, _ = poses_at(dataset.ground_truth, stamps)
    rooms = dataset.rooms[[view.keyframe.frame_index for view in views]]
    return Scene(path, views, poses, find_places(stamps, [v.keyframe.cloud for v in views], poses, rooms))


def ask(name: str, scene: Scene, config: Config) -> Answers:
    """Query and add all keyframes, and verify what the detector proposes."""
    detector = plugins.load("semslam.detectors", name).from_config(config)
    verifier, keyframes = build_verifier(config), [view.keyframe for view in scene.views]
    ranked, closed = np.zeros(len(keyframes)), np.zeros(len(keyframes))
    bar, verified, off, false = 0.0, 0, 0, 0
    for query, view in enumerate(scene.views):
        for candidate in detector.query(view):
            if scene.truth.same[query, candidate.match]:
                ranked[query] = max(ranked[query], candidate.score)
            elif scene.truth.different[query, candidate.match]:
                bar = max(bar, candidate.score)
            outcome = verifier.verify(*ends_of(candidate, keyframes), candidate)
            if isinstance(outcome, LoopConstraint):
                metres, degrees = error_of(outcome, scene.poses)
                right = metres <= POSE_TOLERANCE and degrees <= ANGLE_TOLERANCE
                verified, off = verified + 1, off + (not right)
                false += metres > FALSE_METRES or degrees > FALSE_DEGREES
                gap = keyframes[outcome.query].timestamp - keyframes[outcome.match].timestamp
                closed[query] = max(closed[query], float(right and is_revisit(gap)))
        detector.add(view)
    return Answers(ranked, bar, closed, verified, off, false)


def cost_of(name: str, scene: Scene, config: Config, crowd: int) -> str:
    """A sentence on what a detector keeps of a keyframe, and on the time of a query among many."""
    kind = plugins.load("semslam.detectors", name)
    first, detector = kind.from_config(config), kind.from_config(config)
    assert isinstance(first, Remembering) and isinstance(detector, Remembering), f"{name} cannot be entered repeatedly."
    for view in scene.views:
        first.add(view)
    looks = first.looks()
    sizes = [sum(np.asarray(array).nbytes for array in look.arrays.values()) for look in looks]
    copies = [replace(looks[k % len(looks)], id=k - crowd, timestamp=float(k - 2 * crowd)) for k in range(crowd)]
    detector.recall(copies)
    spent = []
    for view in scene.views:
        start = process_time()
        with one_blas_thread():
            detector.query(view)
        spent.append(1000 * (process_time() - start))
        detector.add(view)
    middle, late = np.percentile(spent, [50, 95])
    return (
        f"{name}, {crowd} keyframes: {np.mean(sizes):.0f} bytes kept of one, {max(sizes)} at most;"
        f" query {middle:.1f} ms, 95 % below {late:.1f} ms"
    )


def error_of(loop: LoopConstraint, poses: FloatArray) -> tuple[float, float]:
    """Metres and degrees by which a loop misses the true relative pose."""
    error = invert(invert(poses[loop.match]) @ poses[loop.query]) @ loop.T_match_query
    return float(np.linalg.norm(error[:3, 3])), float(np.degrees(rotation_angle(error)))


def row(name: str, scene: Scene, answers: Answers) -> str:
    """A line of the table."""
    shares = []
    for values in (answers.ranked > answers.bar, answers.closed):
        for kind in Revisit:
            queries = scene.truth.queries(kind)
            shares.append(f"{values[queries].mean():.2f}" if len(queries) else "")
    return f"| {name} | " + " | ".join(shares) + f" | {answers.verified} | {answers.off} | {answers.false} |"


if __name__ == "__main__":
    main()
