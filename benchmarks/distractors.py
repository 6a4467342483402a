"""A database of thousands of keyframes of many places: time of a query, memory, and loops across places.

    python benchmarks/distractors.py redkitchen rgbd_dataset_freiburg1_rpy_first10s synthetic:house \
        "synthetic:house?seed=1" "synthetic:house?seed=2" --photos NYUV2_DIR [--detectors objects,fused] [--ask 25]

All sequences go into one database with their true poses for odometry, each in a map of its own and PAUSE seconds after
the one before, behind the photos of NYUv2, each a map by itself; a photo's depth has no scale and is taken to end at
5 m. Every ``--ask``-th keyframe queries all before it, and what the detector proposes is verified. Sequences whose
names up to the "?" are the same are one place: a verified loop between two places is false, for no odometry could
refuse it.
Printed for each false loop, between two places or within one: both keyframes and their places, its score and evidence.
Then for each detector: keyframes; bytes kept of each by the detector, mean and largest; processor milliseconds of the
last queries, description included and segmentation not; proposals and verified loops between two places; verified loops
within a place, and those of them that miss the true pose by over 0.5 m or 20 degrees.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

import cv2
import numpy as np

from semslam import plugins
from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.eval.trajectory import poses_at
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import invert, rotation_angle
from semslam.loop.detector import LoopDetector, Remembering
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.verification.submaps import ends_of
from semslam.loop.verification.verifier import LoopVerifier, build_verifier
from semslam.runtime.threads import one_blas_thread
from semslam.types import Frame, Keyframe, KeyframeView, LoopConstraint, Transform

PAUSE = 1000.0
"""Seconds between two sequences."""
PHOTO_SIZE, PHOTO_FOCAL, PHOTO_DEPTH = (640, 480), 518.0, 5.0
"""Pixels, pixels, and metres that the brightest depth of a photo stands for."""
TIMED = 20
"""Queries at the end whose time counts."""
FALSE_METRES, FALSE_DEGREES = 0.5, 20.0


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """A frame with the pose and the place it was taken at."""

    frame: Frame
    T_world_cam: Transform
    place: str
    map_id: int


@dataclass(slots=True, eq=False)
class Tally:
    """What became of a detector's candidates, and the time of each query."""

    spent: list[float]
    proposed_across: int = 0
    verified_across: int = 0
    verified: int = 0
    false: int = 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+")
    parser.add_argument("--photos", type=Path, help="folder of NYUv2, with rgb, unlabelled and depth")
    parser.add_argument("--detectors", default="objects")
    parser.add_argument("--every", type=int, default=1, help="frames from one keyframe to the next")
    parser.add_argument("--ask", type=int, default=10, help="keyframes from one query to the next")
    parser.add_argument("--labels", type=Path, help="folder in which segmentations are kept for the next time")
    parser.add_argument("--frames", type=Path, help="the same for rendered frames")
    args = parser.parse_args()
    config = Config().with_changes(segmentation={"cache_dir": args.labels}, dataset={"cache_dir": args.frames})
    detectors = {
        name: plugins.load("semslam.detectors", name).from_config(config) for name in args.detectors.split(",")
    }
    tallies = {name: Tally([]) for name in detectors}
    verifier, segmenter, builder = build_verifier(config), build_segmenter(config), KeyframeBuilder(config)
    keyframes: list[Keyframe] = []
    shots: list[tuple[str, Transform]] = []
    for shot in everything(args.sequences, args.every, args.photos, config):
        keyframe = builder.build_at(shot.frame, shot.T_world_cam, shot.map_id)
        labels = segmenter.segment(shot.frame.color, shot.frame.depth)
        view = KeyframeView(keyframe, shot.frame.color, shot.frame.depth, labels)
        keyframes.append(keyframe)
        shots.append((shot.place, shot.T_world_cam))
        for name, detector in detectors.items():
            if len(keyframes) % args.ask == 0:
                ask(detector, view, verifier, keyframes, shots, tallies[name])
            detector.add(view)
    print("| detector | keyframes | bytes kept, mean / largest | ms a query, 50 / 95 % | ", end="")
    print("proposed, verified between places | verified within | false |\n|" + "---|" * 7)
    for name, detector in detectors.items():
        print(row(name, detector, tallies[name], len(keyframes)), flush=True)


def everything(sequences: Sequence[str], every: int, photos: Path | None, config: Config) -> Iterator[Shot]:
    """All photos, then all frames, at the times and in the maps that they have in the database."""
    clock, number = 0.0, 0
    for number, frame in enumerate(read_photos(photos) if photos else ()):
        clock += PAUSE
        yield Shot(replace(frame, timestamp=clock), np.eye(4), f"photo {number}", number)
    for path in sequences:
        dataset = open_dataset(path, config.dataset if path.startswith("synthetic") else None)
        assert dataset.ground_truth is not None, f"{path} has no ground truth."
        number, start = number + 1, clock + PAUSE - dataset.timestamps[0]
        for index in range(0, len(dataset), every):
            frame = dataset.frame(index)
            (pose,), (known,) = poses_at(dataset.ground_truth, [frame.timestamp])
            if known:
                clock = frame.timestamp + start
                yield Shot(replace(frame, timestamp=clock), pose, path.split("?")[0], number)


def read_photos(folder: Path) -> Iterator[Frame]:
    """The photos of NYUv2 with their depth, in the order of their names."""
    camera = Intrinsics(*PHOTO_SIZE, PHOTO_FOCAL, PHOTO_FOCAL, PHOTO_SIZE[0] / 2, PHOTO_SIZE[1] / 2)
    paths = sorted([*folder.glob("rgb/*.jpg"), *folder.glob("unlabelled/*.jpg")], key=lambda path: path.name)
    for index, path in enumerate(paths):
        color = cv2.cvtColor(cv2.resize(cv2.imread(str(path)), PHOTO_SIZE), cv2.COLOR_BGR2RGB)
        depth = cv2.imread(str(folder / "depth" / f"{path.stem}.png"), cv2.IMREAD_GRAYSCALE)
        metres = cv2.resize(depth, PHOTO_SIZE, interpolation=cv2.INTER_NEAREST).astype(np.float32)
        yield Frame(index, 0.0, color, metres * np.float32(PHOTO_DEPTH / 255), camera)


def ask(
    detector: LoopDetector, view: KeyframeView, verifier: LoopVerifier, keyframes: Sequence[Keyframe],
    shots: Sequence[tuple[str, Transform]], tally: Tally,
) -> None:  # fmt: skip
    """Query the database, and verify what is proposed."""
    start = process_time()
    with one_blas_thread():
        candidates = detector.query(view)
    tally.spent.append(1000 * (process_time() - start))
    for candidate in candidates:
        across = shots[candidate.query][0] != shots[candidate.match][0]
        tally.proposed_across += across
        outcome = verifier.verify(*ends_of(candidate, keyframes), candidate)
        if isinstance(outcome, LoopConstraint):
            false = not across and is_false(outcome, shots)
            tally.verified_across += across
            tally.verified += not across
            tally.false += false
            if across or false:
                places = (
                    f"{shots[candidate.query][0]} {candidate.query} - {shots[candidate.match][0]} {candidate.match}"
                )
                print(f"{places}: score {candidate.score:.2f}, {candidate.evidence.figures}", flush=True)


def is_false(loop: LoopConstraint, shots: Sequence[tuple[str, Transform]]) -> bool:
    """Whether a loop within a place misses the true relative pose by much."""
    true = invert(shots[loop.match][1]) @ shots[loop.query][1]
    error = invert(true) @ loop.T_match_query
    far = float(np.linalg.norm(error[:3, 3])) > FALSE_METRES
    return far or float(np.degrees(rotation_angle(error))) > FALSE_DEGREES


def row(name: str, detector: LoopDetector, tally: Tally, count: int) -> str:
    """A line of the table."""
    kept = "-"
    if isinstance(detector, Remembering):
        sizes = [sum(np.asarray(array).nbytes for array in look.arrays.values()) for look in detector.looks()]
        kept = f"{np.mean(sizes):.0f} / {max(sizes)}"
    middle, late = np.percentile(tally.spent[-TIMED:], [50, 95])
    across = f"{tally.proposed_across}, {tally.verified_across}"
    return f"| `{name}` | {count} | {kept} | {middle:.1f} / {late:.1f} | {across} | {tally.verified} | {tally.false} |"


if __name__ == "__main__":
    main()
