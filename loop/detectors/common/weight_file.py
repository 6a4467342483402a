"""The weights that detectors ship: reading them with a clear error where they do not fit, and telling them apart."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import numpy.typing as npt

from semslam.errors import ModelError
from semslam.files import read_arrays
from semslam.loop.segmentation.shipped import CHECKPOINT, INT8_GRAPH

SHIPPED_FOLDER = Path(__file__).parents[2] / "weights"
"""Where everything lies that the detectors ship."""
WEIGHT_SUFFIXES = (".npz", ".onnx", ".pt", ".pth")


@contextmanager
def open_weights(path: Path, content: str) -> Iterator[Mapping[str, npt.NDArray[np.generic]]]:
    """Open an npz file; its arrays are to be read inside the ``with``.

    Args:
        path: the file.
        content: what it should hold, for the message, such as "vocabulary".

    Raises:
        ModelError: the file is missing, damaged, or holds something else.
    """
    if not path.exists():
        raise ModelError(f"There is no {content} at {path}.")
    arrays = read_arrays(path, f"The {content}", ModelError)
    try:
        yield arrays
    except (ValueError, KeyError, AttributeError) as error:
        raise ModelError(f"{path} is no {content}, or it is damaged.") from error


def digest_of_weights(others: Sequence[Path]) -> str:
    """SHA-256 of all that detectors and segmentation have learned: what ships, and other files."""
    digest = hashlib.sha256()
    for path in (*sorted(SHIPPED_FOLDER.glob("*.npz")), CHECKPOINT, INT8_GRAPH, *others):
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def load_min_score(path: Path, content: str) -> float:
    """Read the score that 99 in 100 pairs of photos of different places stay below.

    Raises:
        ModelError: the file is missing or damaged.
    """
    with open_weights(path, content) as arrays:
        return float(arrays["min_score"].astype(float))
