"""Stacked denoising autoencoder on patches (Gao and Zhang, Autonomous Robots 2017)."""

from typing import Self

import cv2
import numpy as np

from semslam.config import Config, LoopConfig
from semslam.loop.detector import Arrays
from semslam.loop.detectors.common.growing import GrowingArray
from semslam.loop.detectors.common.remembering import RememberingDetector
from semslam.loop.detectors.common.weight_file import SHIPPED_FOLDER
from semslam.loop.detectors.sda.autoencoder import Autoencoder, load_autoencoder
from semslam.types import Float32Array, FloatArray, KeyframeView, LoopCandidate, LoopEvidence, UInt8Array

SHIPPED = SHIPPED_FOLDER / "autoencoder.npz"
WIDTH, HEIGHT = 320, 240
COLUMNS, ROWS = 8, 6
PATCH = 41
REACH = 2
MIN_SCORE = 0.82


class SdaDetector(RememberingDetector[Float32Array]):
    """Hidden codes of patches around keypoints, compared patch by patch.

    The strongest corner of each cell of an 8 x 6 grid gives a patch of 41 x 41 pixels; two layers turn it into a
    code of 50 values, whitened with the training photos' mean and deviation. A row of the similarity matrix is the
    mean over the query's patches of the best cosine with a patch at most two cells away. The original trains on the
    sequence it is run on and takes its pictures in order; here the network is trained on other photos.
    """

    name = "sda"
    needs_labels = False

    def __init__(self, loops: LoopConfig, network: Autoencoder) -> None:
        super().__init__(loops, MIN_SCORE)
        self._network = network
        self._clear()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the section ``loops``.

        Raises:
            ModelError: the shipped weights are missing or damaged.
        """
        return cls(config.loops, load_autoencoder(SHIPPED))

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates by mean similarity of patches."""
        scores = _similarity(self._look(view), self._codes.rows)
        return [
            LoopCandidate(
                view.keyframe.id, self._timeline.id_at(at), float(scores[at]), self.name,
                LoopEvidence(figures={"patches": float(scores[at])}),
            )
            for at in self._timeline.best(view.keyframe, scores)
        ]  # fmt: skip

    def _describe(self, view: KeyframeView) -> Float32Array:
        return self._network.encode(cut_patches(view.color))

    def _clear(self) -> None:
        self._codes = GrowingArray(np.float32, (COLUMNS * ROWS, self._network.size))

    def _enter(self, look: Float32Array) -> None:
        self._codes.append(look[None])

    def _to_arrays(self, look: Float32Array) -> Arrays:
        return {"codes": look}

    def _from_arrays(self, arrays: Arrays) -> Float32Array:
        return np.asarray(arrays["codes"], dtype=np.float32)


def cut_patches(color: UInt8Array) -> Float32Array:
    """Patches (48, 41 * 41) in 0..1 around the strongest corner of each cell, after contrast is evened out."""
    gray = cv2.resize(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    cell_width, cell_height = WIDTH // COLUMNS, HEIGHT // ROWS
    corners = cv2.cornerMinEigenVal(gray, 5).reshape(ROWS, cell_height, COLUMNS, cell_width)
    v, u = np.divmod(corners.transpose(0, 2, 1, 3).reshape(ROWS * COLUMNS, -1).argmax(axis=1), cell_width)
    row, column = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    even = gray.astype(np.float32) / 255
    even = (even - even.mean()) / (even.std() + 0.02) / 6 + 0.5
    centres = np.column_stack([column * cell_width + u, row * cell_height + v]).astype(np.float64)
    patches = [cv2.getRectSubPix(even.astype(np.float32), (PATCH, PATCH), (x, y)) for x, y in centres]
    return np.asarray(np.clip(np.array(patches).reshape(len(patches), -1), 0, 1), dtype=np.float32)


def _similarity(query: Float32Array, others: Float32Array) -> FloatArray:
    """Mean best cosine (N,), not below 0, of codes (P, D) with those of N images (N, P, D)."""
    row, column = np.divmod(np.arange(COLUMNS * ROWS), COLUMNS)
    total = np.zeros(len(others))
    for patch, code in enumerate(query):
        near = (np.abs(row - row[patch]) <= REACH) & (np.abs(column - column[patch]) <= REACH)
        total += (others[:, near] @ code).max(axis=1)
    return np.clip(total / len(query), 0.0, 1.0)
