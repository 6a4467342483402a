"""Motion between map keyframes as registered images give it: what holds an adjustment where landmarks are few."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semslam.frontend.direct.search import Registered
from semslam.geometry.se3 import adjoint, invert, tangents
from semslam.types import Covariance6, FloatArray, Transform, Transforms

GATE = 25.0
"""Squared Mahalanobis distance from which a link counts less: images may have been matched wrongly."""


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """The relative pose of two keyframes.

    Attributes:
        earlier, later: the keyframes.
        T_earlier_later: (4, 4).
        information: (6, 6), rotation first, in the later one's frame.
    """

    earlier: int
    later: int
    T_earlier_later: Transform
    information: FloatArray


def link_errors(links: Sequence[Link], poses: Transforms) -> FloatArray:
    """Deviations (L, 6) of poses (P, 4, 4) from links, each in the later keyframe's frame."""
    measured = np.stack([link.T_earlier_later for link in links])
    earlier, later = poses[[link.earlier for link in links]], poses[[link.later for link in links]]
    return tangents(invert(measured) @ invert(earlier) @ later)


def link_cost(links: Sequence[Link], poses: Transforms) -> float:
    """Sum of the robust squared distances of poses (P, 4, 4) from links."""
    if not links:
        return 0.0
    squared = _squared(links, link_errors(links, poses))
    return float(np.where(squared <= GATE, squared, 2.0 * np.sqrt(GATE * squared) - GATE).sum())


def _squared(links: Sequence[Link], off: FloatArray) -> FloatArray:
    """Squared Mahalanobis distances (L,) of errors (L, 6)."""
    information = np.stack([link.information for link in links])
    return np.asarray((off[:, None, :] @ information @ off[:, :, None])[:, 0, 0])


class ImageChain:
    """Adds up the motions of registered images from a keyframe on; broken by a frame whose images did not match."""

    def __init__(self) -> None:
        self._T: Transform | None = None
        self._covariance: Covariance6 = np.zeros((6, 6))

    def begin(self) -> None:
        """Begin at the newest frame."""
        self._T, self._covariance = np.eye(4), np.zeros((6, 6))

    def extend(self, images: Registered | None) -> None:
        """Take the newest frame's motion since the frame before, or none."""
        if images is None or self._T is None:
            self._T = None
            return
        back = adjoint(invert(images.T_ref_cam))
        self._covariance = back @ self._covariance @ back.T + np.linalg.inv(images.information)
        self._T = self._T @ images.T_ref_cam

    def link(self, earlier: int, later: int) -> Link | None:
        """The link from the keyframe where it began to that of the newest frame; None where it was broken."""
        if self._T is None:
            return None
        return Link(earlier, later, self._T, np.asarray(np.linalg.inv(self._covariance), dtype=np.float64))


def add_links(links: Sequence[Link], poses: Transforms, free: int, scale: float, H: FloatArray, g: FloatArray) -> None:
    """Add links to the normal equations of free poses' tangents, H (6 F, 6 F) and g (6 F,), in place.

    Args:
        links: between rows of ``poses``.
        poses: (P, 4, 4), of which the first ``free`` move.
        free: how many.
        scale: factor on their information.
        H: sums of information.
        g: gradients, of what was measured less what the poses give.
    """
    if not links:
        return
    all_off = link_errors(links, poses)
    shares = scale * np.sqrt(GATE / np.maximum(_squared(links, all_off), GATE))
    for link, off, share in zip(links, all_off, shares, strict=True):
        T_earlier, T_later = poses[link.earlier], poses[link.later]
        weight = share * link.information
        parts = [(link.later, np.eye(6)), (link.earlier, -adjoint(invert(T_later) @ T_earlier))]
        moving = [(slice(6 * row, 6 * row + 6), J) for row, J in parts if row < free]
        for rows, J in moving:
            g[rows] -= J.T @ weight @ off
            for columns, other in moving:
                H[rows, columns] += J.T @ weight @ other
