"""Relative pose and covariance of any two keyframes by odometry alone."""

from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from semslam.backend.graph.keys import chain_of
from semslam.backend.graph.products import Edge
from semslam.geometry.se3 import invert, orthonormalise, rotation_angle
from semslam.types import Covariance6, FloatArray, IntArray, Transforms

BoolArray = npt.NDArray[np.bool_]


class OdometryChain:
    """Odometry summed up from keyframe to keyframe, so that any pair is answered at once.

    A chain runs through keys of one trajectory that follow one another and are joined by an edge; it breaks where
    they are not.
    Covariances are summed in the frame of the chain's start by the adjoint, to first order.
    """

    def __init__(self, keys: Iterable[int], odometry: Iterable[Edge]) -> None:
        ordered = sorted(keys)
        steps = {(edge.from_key, edge.to_key): edge for edge in odometry}
        self._keys = np.array(ordered, dtype=np.int64)
        self._T = np.tile(np.eye(4), (len(ordered), 1, 1))
        self._chain = np.zeros(len(ordered), dtype=np.int64)
        covariances = np.zeros((len(ordered), 6, 6))
        right = np.arange(len(ordered))  # an edge's covariance belongs to its right end
        for row, (last, key) in enumerate(pairwise(ordered), 1):
            forward, backward = steps.get((last, key)), steps.get((key, last))
            edge = (forward or backward) if chain_of(last) == chain_of(key) else None
            self._chain[row] = self._chain[row - 1] + (edge is None)
            if edge is None:
                continue
            T_last_key = edge.T_from_to if forward else invert(edge.T_from_to)
            self._T[row] = orthonormalise(self._T[row - 1] @ T_last_key)
            covariances[row] = edge.covariance
            right[row] = row if forward else row - 1
        Ad = adjoints(self._T[right])
        self._covariance = Ad @ covariances @ np.swapaxes(Ad, 1, 2)
        for chain in np.split(self._covariance, np.flatnonzero(np.diff(self._chain)) + 1):
            np.cumsum(chain, axis=0, out=chain)

    def relative(self, a: npt.ArrayLike, b: npt.ArrayLike) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Relative poses of pairs of keyframes.

        Args:
            a: (L,) keys.
            b: (L,) keys.

        Returns:
            T_a_b (L, 4, 4), covariances (L, 6, 6) in the frame of b, and (L,) whether odometry joins the pair.
        """
        rows_a, rows_b = self._rows(a), self._rows(b)
        T_b = self._T[rows_b]
        Ad = adjoints(invert(T_b))
        # The way from the chain's start to the earlier of the two is shared and cancels.
        shared = self._covariance[np.minimum(rows_a, rows_b)]
        covariance = Ad @ (self._covariance[np.maximum(rows_a, rows_b)] - shared) @ np.swapaxes(Ad, 1, 2)
        return invert(self._T[rows_a]) @ T_b, covariance, self.joins(a, b)

    def joins(self, a: npt.ArrayLike, b: npt.ArrayLike) -> BoolArray:
        """Whether odometry joins pairs of keyframes (L,), (L,)."""
        return np.asarray(self._chain[self._rows(a)] == self._chain[self._rows(b)])

    def poses(self) -> Iterator[tuple[int, int, FloatArray]]:
        """Each key, the key its chain starts with, and its pose (4, 4) in that one."""
        first = np.searchsorted(self._chain, self._chain)
        for row, start in enumerate(first.tolist()):
            yield int(self._keys[row]), int(self._keys[start]), self._T[row]

    def _rows(self, keys: npt.ArrayLike) -> IntArray:
        return np.searchsorted(self._keys, np.asarray(keys).ravel()).astype(np.int64)


def adjoints(T: Transforms) -> FloatArray:
    """Adjoints (L, 6, 6) of transforms (L, 4, 4), rotation first."""
    out = np.zeros((len(T), 6, 6))
    R, t = T[:, :3, :3], T[:, :3, 3]
    out[:, :3, :3] = out[:, 3:, 3:] = R
    skew = np.zeros((len(T), 3, 3))
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -t[:, 2], t[:, 1], -t[:, 0]
    out[:, 3:, :3] = (skew - np.swapaxes(skew, 1, 2)) @ R
    return out


def deviations(T: Transforms) -> FloatArray:
    """Rotation vectors and translations (L, 6) of small transforms (L, 4, 4)."""
    R = T[:, :3, :3]
    axis = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], -1)
    length = np.maximum(np.linalg.norm(axis, axis=1), 1e-12)
    return np.hstack([axis * (rotation_angle(T) / length)[:, None], T[:, :3, 3]])


def squared_mahalanobis(deviation: FloatArray, covariance: Covariance6) -> FloatArray:
    """Squared Mahalanobis lengths (L,) of deviations (L, 6) under covariances (L, 6, 6)."""
    return np.asarray((deviation * np.linalg.solve(covariance, deviation[..., None])[..., 0]).sum(-1))
