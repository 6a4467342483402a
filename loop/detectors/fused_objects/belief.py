"""How probable it is that two submaps were matched rightly."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semslam.loop.detectors.common.weight_file import SHIPPED_FOLDER, open_weights
from semslam.types import FloatArray, LoopCandidate

SHIPPED = SHIPPED_FOLDER / "submaps.npz"


@dataclass(frozen=True, slots=True, eq=False)
class SubmapBelief:
    """A logistic function of what `objects` states of a candidate.

    Attributes:
        weights: (3,) of the score, the rival's share of the votes, and the logarithm of the number of matched objects.
        bias: of the logistic score.
    """

    weights: FloatArray
    bias: float

    def probabilities(self, candidates: Sequence[LoopCandidate]) -> FloatArray:
        """Probability (N,) that each candidate's guess is right."""
        score = evidence_of(candidates) @ self.weights + self.bias
        return np.asarray(1.0 / (1.0 + np.exp(-score)))

    def save(self, path: Path) -> None:
        """Write it as an npz."""
        np.savez(path, weights=self.weights, bias=np.float64(self.bias))


def evidence_of(candidates: Sequence[LoopCandidate]) -> FloatArray:
    """What is known of candidates of `objects`, (N, 3); see ``SubmapBelief.weights``."""
    rows = [(c.score, c.evidence.figures["rival"], c.evidence.figures["matched_objects"]) for c in candidates]
    known = np.array(rows, dtype=np.float64).reshape(-1, 3)
    known[:, 2] = np.log(np.maximum(known[:, 2], 1.0))
    return known


def load_belief(path: Path = SHIPPED) -> SubmapBelief:
    """Read it.

    Raises:
        ModelError: the file is missing or damaged.
    """
    with open_weights(path, "submap belief") as arrays:
        return SubmapBelief(arrays["weights"].astype(np.float64), float(arrays["bias"].astype(np.float64)))
