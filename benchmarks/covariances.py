"""What the covariances of each odometry are worth.

    python benchmarks/drift.py run SEQUENCE... --folder DIR
    python benchmarks/covariances.py SEQUENCE... --folder DIR

Compares what each odometry that ``drift.py`` has recorded in DIR states with the truth, over a keyframe's distance: the
normalised squared error divided by its six degrees of freedom, 1 where a covariance is right.
"""

import argparse
from pathlib import Path

import numpy as np

from semslam import plugins
from semslam.config import Config
from semslam.datasets import Dataset, open_dataset
from semslam.eval.nees import DEGREES_OF_FREEDOM, nees
from semslam.eval.trajectory import poses_at
from semslam.geometry.se3 import adjoint, invert
from semslam.runs.recording import Recording, read_recording
from semslam.types import FloatArray, TrackingStatus


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", nargs="+")
    parser.add_argument("--folder", type=Path, required=True)
    arguments = parser.parse_args()
    print("| sequence | odometry | starts | squared error, 50 / 90 / 99 % |\n|---|---|---|---|")
    for sequence in arguments.sequences:
        dataset = open_dataset(sequence)
        for odometry in plugins.names("semslam.odometry"):
            kept = sorted(arguments.folder.glob(f"{dataset.name}-{odometry}-[0-9]"))
            errors = np.concatenate([normalised_errors(read_recording(path), dataset) for path in kept] or [[]])
            if len(errors):
                spread = " / ".join(f"{value:.2f}" for value in np.percentile(errors, [50, 90, 99]))
                print(f"| {dataset.name} | {odometry} | {len(kept)} | {spread} |", flush=True)


def normalised_errors(recording: Recording, dataset: Dataset) -> FloatArray:
    """Squared errors (N,) of the stated motion over stretches of a keyframe's distance that were tracked throughout."""
    assert dataset.ground_truth is not None, f"{dataset.name} has no ground truth."
    frames = recording.frames
    stamps = [frame.timestamp for frame in frames]
    truth, known = poses_at(dataset.ground_truth, stamps)
    stride = max(round(Config().keyframes.interval / float(np.median(np.diff(stamps)))), 1)
    errors, covariances = [], []
    for first in range(0, len(frames) - stride, stride):
        last, T, covariance = first + stride, np.eye(4), np.zeros((6, 6))
        motions = [frame.motion for frame in frames[first + 1 : last + 1]]
        if not (known[first] and known[last]) or any(motion.status is TrackingStatus.LOST for motion in motions):
            continue
        for motion in motions:
            Ad = adjoint(invert(motion.T_prev_cur))
            covariance = Ad @ covariance @ Ad.T + motion.covariance
            T = T @ motion.T_prev_cur
        errors.append(invert(invert(truth[first]) @ truth[last]) @ T)
        covariances.append(covariance)
    return nees(np.array(errors).reshape(-1, 4, 4), np.array(covariances).reshape(-1, 6, 6)) / DEGREES_OF_FREEDOM


if __name__ == "__main__":
    main()
