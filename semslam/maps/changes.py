"""What differs between two semantic maps of one place: things that are gone, new, or stand elsewhere."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import invert, transform_points
from semslam.maps.semantic.objects import DENSE, STRUCTURE, box
from semslam.maps.semantic.semantic_map import SemanticMap
from semslam.maps.views import MAX_DEPTH, PosedView
from semslam.types import Cloud, FloatArray, IntArray

TOLERANCE, GROWTH = 0.08, 0.02
"""Metres by which a depth may miss a surface that it meets, and what is added for each metre of depth."""
REACH = 5.0
"""Voxels; changed points within this distance belong to one thing: parts of it may not be seen to change."""
NEAREST = 0.2
"""Metres; closer to the camera nothing is seen."""
FREE_SHARE = 0.8
"""Share of the views which meet a point or look through it that must look through it."""
MIN_COSINE = 0.3
"""Cosine between a point's normal and a ray; a more grazing view meets the surface far from where it is."""
MIN_AREA = 0.04
"""Square metres of changed surface; less is noise."""
MAX_MOVE = 3.0
"""Metres; farther apart, a thing that is gone and one that is new are two things."""
LIKE = 0.5
"""Ratio that the smaller of two areas must have to the larger one for one thing to be the other moved."""


class ChangeKind(StrEnum):
    """What happened to a thing."""

    GONE = "gone"
    NEW = "new"
    MOVED = "moved"


@dataclass(frozen=True, slots=True, eq=False)
class ChangedThing:
    """Surface that is in one map, and where the other's views look through.

    Attributes:
        name: the class of most of its points.
        share: of its points that have this class, 0..1.
        centroid: (3,) metres.
        extent: (3,) metres along its principal axes.
        area_m2: its surface.
    """

    name: str
    share: float
    centroid: FloatArray
    extent: FloatArray
    area_m2: float


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """One difference: a thing as it was, as it is, or both where it moved."""

    kind: ChangeKind
    before: ChangedThing | None
    after: ChangedThing | None

    @property
    def distance_m(self) -> float | None:
        """Metres between both places of a thing that moved."""
        if self.before is None or self.after is None:
            return None
        return float(np.linalg.norm(self.after.centroid - self.before.centroid))


class Transparency:
    """Counts, for points of a map, how many views meet a surface there and how many look through.

    Args:
        cloud: the points, in the world of the views.
    """

    def __init__(self, cloud: Cloud) -> None:
        self._points, self._normals = cloud.points.astype(np.float64), cloud.normals
        self._met = np.zeros(len(cloud), dtype=np.int64)
        self._through = np.zeros(len(cloud), dtype=np.int64)

    def add(self, view: PosedView) -> None:
        """Look at the points from one view; a pixel counts with its eight neighbours, as poses are not exact."""
        camera, depth = view.frame.intrinsics, view.frame.depth
        ideal = camera.undistort_image(depth, cv2.INTER_NEAREST)
        kernel = np.ones((3, 3), dtype=np.uint8)
        farthest = cv2.dilate(ideal, kernel)
        nearest = cv2.erode(np.where(ideal > 0, ideal, np.float32(np.inf)), kernel)
        local = transform_points(invert(view.T_world_cam), self._points)
        rays = self._points - view.T_world_cam[:3, 3]
        cosine = np.abs((rays * self._normals).sum(axis=1)) / np.maximum(np.linalg.norm(rays, axis=1), 1e-9)
        ahead = np.flatnonzero((local[:, 2] > NEAREST) & (local[:, 2] < MAX_DEPTH) & (cosine > MIN_COSINE))
        pixels = np.rint(camera.project(local[ahead])).astype(np.int64)
        inside = ((pixels >= 0) & (pixels < (camera.width, camera.height))).all(axis=1)
        rows, (u, v) = ahead[inside], pixels[inside].T
        z = local[rows, 2]
        slack = TOLERANCE + GROWTH * z
        low, high = nearest[v, u], farthest[v, u]
        self._met[rows] += (high > 0) & (low <= z + slack) & (high >= z - slack)
        self._through[rows] += (ideal[v, u] > 0) & (low > z + slack)

    @property
    def met(self) -> npt.NDArray[np.bool_]:
        """Which points (N,) lie on a surface that was seen."""
        return self._met > 0

    @property
    def free(self) -> npt.NDArray[np.bool_]:
        """Which points (N,) were looked through."""
        return (self._through > 0) & (self._through >= FREE_SHARE * (self._met + self._through))


def compare(
    before: SemanticMap, after: SemanticMap, views_before: Iterable[PosedView], views_after: Iterable[PosedView]
) -> tuple[Change, ...]:
    """Find what changed between two maps that share one world; first what moved, then what is gone, then what is new.

    A thing is gone where the later views look through its surface, and new where the earlier ones look through it.
    One that is gone and one that is new are the same thing moved if they are of one class and about one size and
    not too far apart; the nearest pairs are taken first. What a pass did not look at is no change.

    Args:
        before: the earlier map.
        after: the later one.
        views_before: the views that the earlier map was made of.
        views_after: those of the later one.
    """
    gone = _things(before, _looked_through(before, views_after))
    new = _things(after, _looked_through(after, views_before))
    pairs = sorted(
        (float(np.linalg.norm(a.centroid - b.centroid)), i, j)
        for i, a in enumerate(gone)
        for j, b in enumerate(new)
        if a.name == b.name and min(a.area_m2, b.area_m2) >= LIKE * max(a.area_m2, b.area_m2)
    )
    old: dict[int, int] = {}
    for distance, i, j in pairs:
        if distance <= MAX_MOVE and i not in old and j not in old.values():
            old[i] = j
    moved = [Change(ChangeKind.MOVED, gone[i], new[j]) for i, j in sorted(old.items())]
    lost = [Change(ChangeKind.GONE, thing, None) for i, thing in enumerate(gone) if i not in old]
    added = [Change(ChangeKind.NEW, None, thing) for j, thing in enumerate(new) if j not in old.values()]
    return (*moved, *lost, *added)


def _looked_through(built: SemanticMap, views: Iterable[PosedView]) -> IntArray:
    transparency = Transparency(built.cloud)
    for view in views:
        transparency.add(view)
    return np.flatnonzero(transparency.free)


def _things(built: SemanticMap, rows: IntArray) -> list[ChangedThing]:
    """The changed points that lie together and are no part of the building, the largest first."""
    if len(rows) < DENSE:
        return []
    from sklearn.cluster import DBSCAN

    groups = DBSCAN(eps=REACH * built.voxel, min_samples=DENSE).fit_predict(built.cloud.points[rows])
    clusters: Sequence[IntArray] = [rows[groups == group] for group in range(groups.max() + 1)]
    cell = built.voxel**2
    things = [_thing(built, cluster) for cluster in clusters if len(cluster) * cell >= MIN_AREA]
    # Walls and floors stay where they are; where they seem to go, poses or depth were wrong.
    return sorted((t for t in things if t.name not in STRUCTURE), key=lambda thing: -thing.area_m2)


def _thing(built: SemanticMap, rows: IntArray) -> ChangedThing:
    votes = np.bincount(built.labels[rows], weights=built.confidence[rows], minlength=len(built.names))
    label = int(votes.argmax())
    centroid, extent, _ = box(built.cloud.points[rows])
    share = float(np.mean(built.labels[rows] == label))
    return ChangedThing(built.names[label], share, centroid, extent, len(rows) * built.voxel**2)
