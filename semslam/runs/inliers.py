"""A sample of each verified loop's inlier matches, stored for the report."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from semslam.errors import ResultsError
from semslam.files import read_arrays
from semslam.types import FloatArray, Keyframe, LoopConstraint, Verification

FILE = "inliers.npz"
MOST = 40
"""Matches kept of a loop; more would hide the images."""


def write_inliers(directory: Path, outcomes: Sequence[Verification], keyframes: Sequence[Keyframe]) -> None:
    """Write evenly chosen inliers of each verified candidate that has some.

    Args:
        directory: the run folder.
        outcomes: each candidate's outcome, in the ledger's order.
        keyframes: ``keyframes[i].id`` is i.
    """
    found = {index: _pixels(loop, keyframes) for index, loop in enumerate(outcomes) if isinstance(loop, LoopConstraint)}
    found = {index: pixels for index, pixels in found.items() if len(pixels)}
    np.savez_compressed(
        directory / FILE,
        entries=np.array(list(found), np.int64),
        counts=np.array([len(pixels) for pixels in found.values()], np.int64),
        pixels=np.concatenate([np.empty((0, 4)), *found.values()]).astype(np.float32),
    )


def read_inliers(directory: Path) -> Mapping[int, FloatArray]:
    """(K, 4) pixels u, v in the query and u, v in the match, by line of the ledger; empty where the run has none.

    Raises:
        ResultsError: the file is damaged.
    """
    path = directory / FILE
    if not path.exists():
        return {}
    arrays = read_arrays(path, "The file of inliers", ResultsError)
    try:
        entries, counts, pixels = arrays["entries"], arrays["counts"], arrays["pixels"].astype(np.float64)
        if len(entries) != len(counts) or counts.sum() != len(pixels) or pixels.shape[1:] != (4,):
            raise ValueError("lengths differ")
        return (
            dict(zip(entries.tolist(), np.split(pixels, np.cumsum(counts)[:-1]), strict=True)) if len(entries) else {}
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ResultsError(f"The inliers {path} are damaged.") from error


def _pixels(loop: LoopConstraint, keyframes: Sequence[Keyframe]) -> FloatArray:
    if loop.shared is None or not len(loop.shared):
        return np.empty((0, 4))
    chosen = loop.shared[np.linspace(0, len(loop.shared) - 1, min(MOST, len(loop.shared))).round().astype(int)]
    query, match = (keyframes[id].finest.pixels for id in (loop.query, loop.match))
    return np.concatenate([query[chosen[:, 0]], match[chosen[:, 1]]], axis=1).astype(np.float64)
