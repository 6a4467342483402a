"""How right the semantic map of a rendered scene is, and what a comparison of two passes finds.

    semslam run "synthetic:house" --out RUN --no-plots
    python benchmarks/maps.py labels RUN...

    semslam run "synthetic:house?moved=1" --out RUN --no-plots
    python benchmarks/maps.py changes RUN...

``labels`` prints the mean IoU over the classes present of single views and of the fused map, against the renderer's
true labels, twice: over the pixels of all keyframes (each pixel takes the label of the voxel it falls into, so both
rows are of the same pixels), and over the map's points (a point's true label is that of most pixels that fell into
it; a single view then gives each of its pixels' labels to their points). Then the objects. The true ones are those
that the same search finds in a map of true labels and true poses. One is found if an object of its class lies within
0.3 m of its centroid, misplaced if within 1 m, else missed; objects of the run that no true one takes are invented.

``changes`` compares the second pass with the first, as ``semslam diff RUN --at`` does. The true changes are the parts
that stand in one of the two scenes alone, joined to things where they touch. One has to be found if the keyframes show
at least 400 square centimetres of it in the pass where it stands, where the other pass looks through (by true poses).
A difference that was found is right, whether it had to be found or not, if its centre lies within 15 cm of the box
around a true one of its kind; one that moved counts twice, as gone there and new here.
"""

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse.csgraph import connected_components

from semslam.datasets.synthetic import SyntheticDataset
from semslam.datasets.synthetic.shapes import Part
from semslam.eval.trajectory import associate, fit_alignment
from semslam.geometry.voxels import voxel_keys
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.loop.segmentation.training.evaluation import confusion_matrix, score
from semslam.maps.changes import MIN_AREA, Transparency
from semslam.maps.semantic.objects import MapObject
from semslam.maps.semantic.semantic_map import SemanticMap, build_semantic_map
from semslam.maps.views import PosedView, sample
from semslam.runs.differences import find_changes
from semslam.runs.saved_views import SavedViews, open_saved
from semslam.types import Cloud, Float32Array, FloatArray, IntArray, LabelMap, Points3, Transform, UInt8Array

MARGIN = 0.15
NEAR, FAR = 0.3, 1.0
"""Metres between centroids up to which an object is found, and up to which it is misplaced."""


class Remembered:
    """A segmenter that keeps what it answered, by frame."""

    def __init__(self, saved: SavedViews) -> None:
        self._segmenter = build_segmenter(saved.run.config)
        self.name, self.names, self.fingerprint = "remembered", self._segmenter.names, ""
        self.kept: dict[int, UInt8Array] = {}

    def segment(self, color: UInt8Array, depth: Float32Array | None = None, frame_index: int | None = None) -> LabelMap:
        """Ask, and keep the labels."""
        answer = self._segmenter.segment(color, depth, frame_index)
        self.kept[frame_index or 0] = answer.labels
        return answer


class TrueLabels:
    """The renderer's labels in a segmenter's place."""

    def __init__(self, dataset: SyntheticDataset) -> None:
        self.name, self.names, self.fingerprint = "true", NYU40_NAMES, ""
        self._dataset = dataset
        self.kept: dict[int, UInt8Array] = {}

    def segment(self, color: UInt8Array, depth: Float32Array | None = None, frame_index: int | None = None) -> LabelMap:
        """Render the labels of a frame, or give those rendered before."""
        index = frame_index or 0
        if index not in self.kept:
            self.kept[index] = self._dataset.labels(index)
        return LabelMap(self.kept[index], self.names)


@dataclass(frozen=True)
class Objects:
    """Counts of true objects by what became of them, and of objects that are none."""

    found: int
    misplaced: int
    missed: int
    invented: int


def rows_of(built: SemanticMap, points: Points3) -> IntArray:
    """The map's row of each point (N, 3) that its views were made of."""
    order = np.argsort(built.keys)
    return order[np.searchsorted(built.keys[order], voxel_keys(points, built.voxel))]


def labels_table(built: SemanticMap, views: Sequence[PosedView], single: Remembered, truth: TrueLabels) -> None:
    """Print mIoU and accuracy of single views and of the map."""
    votes = np.zeros((len(built.cloud), len(built.names)), dtype=np.int64)
    pixels_alone, pixels_map = np.zeros((2, len(built.names), len(built.names)), dtype=np.int64)
    seen = []
    for view in views:
        samples = sample(view)
        rows = rows_of(built, samples.points)
        true, alone = (
            truth.kept[view.frame.source_index][samples.mask],
            single.kept[view.frame.source_index][samples.mask],
        )
        np.add.at(votes, (rows, true), 1)
        pixels_alone += confusion_matrix(true, alone)
        pixels_map += confusion_matrix(true, built.labels[rows])
        seen.append((rows, alone))
    of_points = votes.argmax(axis=1).astype(np.uint8)
    points_alone = sum(confusion_matrix(of_points[rows], alone) for rows, alone in seen)
    points_map = confusion_matrix(of_points, built.labels)
    print("| over | single views: mIoU | accuracy | map: mIoU | accuracy | gain, points of mIoU |")
    print("|---|---|---|---|---|---|")
    for name, alone, fused in (("pixels", pixels_alone, pixels_map), ("map points", points_alone, points_map)):
        a, b = score(alone), score(fused)
        print(
            f"| {name} | {a.miou:.3f} | {a.pixel_accuracy:.3f} | {b.miou:.3f} | {b.pixel_accuracy:.3f} "
            f"| {100 * (b.miou - a.miou):+.1f} |"
        )
    right = built.labels == of_points
    for low, high in ((0.0, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.01)):
        inside = (built.confidence >= low) & (built.confidence < high)
        if inside.any():
            print(
                f"confidence {low:.2f} to {min(high, 1):.2f}: {inside.sum()} points, "
                f"mean {built.confidence[inside].mean():.2f}, right {right[inside].mean():.2f}"
            )


def compare_objects(found: Sequence[MapObject], true: Sequence[MapObject], T: Transform) -> Objects:
    """Match objects of the run, moved by ``T`` (4, 4) into the true world, to the true ones, the nearest first."""
    pairs = [
        (float(np.linalg.norm(T[:3, :3] @ a.centroid + T[:3, 3] - b.centroid)), a.id, b.id)
        for a in found
        for b in true
        if a.name == b.name
    ]
    taken: dict[int, float] = {}
    used: set[int] = set()
    for distance, a, b in sorted(pairs):
        if distance <= FAR and a not in used and b not in taken:
            taken[b] = distance
            used.add(a)
    near = sum(distance <= NEAR for distance in taken.values())
    return Objects(near, len(taken) - near, len(true) - len(taken), len(found) - len(used))


def labels(directory: Path) -> None:
    """All figures of one run's semantic map."""
    saved = open_saved(directory)
    dataset = saved.dataset
    assert isinstance(dataset, SyntheticDataset)
    views = list(saved.read())
    single, truth = Remembered(saved), TrueLabels(dataset)
    built = build_semantic_map(views, single)
    stamps = np.searchsorted(dataset.timestamps, [v.frame.timestamp for v in views])
    exact = [PosedView(v.keyframe, v.frame, dataset.ground_truth.poses[i]) for v, i in zip(views, stamps, strict=True)]
    ideal = build_semantic_map(exact, truth)
    print(f"\n{directory}: {len(views)} keyframes, {len(built.cloud)} points\n")
    labels_table(built, views, single, truth)
    T = fit_alignment(associate(saved.run.keyframes, dataset.ground_truth)).T
    counts = compare_objects(built.objects, ideal.objects, T)
    print(f"\nObjects, {len(ideal.objects)} true: {counts}")
    by_class = Counter(thing.name for thing in ideal.objects)
    for name, count in by_class.most_common():
        some = [[thing for thing in things if thing.name == name] for things in (built.objects, ideal.objects)]
        print(f"  {name} ({count}): {compare_objects(*some, T)}")


@dataclass(frozen=True)
class TrueThing:
    """A thing that stands in one scene alone: points (N, 3) on its surface with normals, its class and its area."""

    name: str
    cloud: Cloud
    area_m2: float

    def holds(self, centroid: FloatArray) -> bool:
        """Whether a place lies in the box around it, or within 15 cm of it."""
        low, high = self.cloud.points.min(axis=0), self.cloud.points.max(axis=0)
        return bool(((centroid >= low - MARGIN) & (centroid <= high + MARGIN)).all())


def things_only_in(parts: Sequence[Part], others: Sequence[Part]) -> list[TrueThing]:
    """The parts that do not stand so among the others, joined where their boxes touch."""
    known = {(part.label, part.vertices.round(4).tobytes()) for part in others}
    left = [part for part in parts if (part.label, part.vertices.round(4).tobytes()) not in known]
    low = np.array([part.vertices.min(axis=0) for part in left]) - 0.03
    high = np.array([part.vertices.max(axis=0) for part in left]) + 0.03
    touching = ((low[:, None] <= high[None]) & (high[:, None] >= low[None])).all(axis=2)
    count, group = connected_components(touching)
    return [true_thing([part for part, g in zip(left, group, strict=True) if g == k]) for k in range(count)]


def true_thing(parts: Sequence[Part]) -> TrueThing:
    """Points at random on the surface of some parts, a thousand for each square metre."""
    rng = np.random.default_rng(0)
    points, normals, areas = [], [], []
    for part in parts:
        a, b, c = (part.vertices[part.triangles[:, k]] for k in range(3))
        cross = np.cross(b - a, c - a)
        size = np.linalg.norm(cross, axis=1) / 2
        row = rng.choice(len(size), max(1, round(1000 * size.sum())), p=size / size.sum())
        u, v = rng.random((2, len(row), 1))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        points.append(a[row] + u * (b - a)[row] + v * (c - a)[row])
        normals.append(cross[row] / (2 * size[row, None]))
        areas.append(float(size.sum()))
    cloud = Cloud(np.concatenate(points).astype(np.float32), np.concatenate(normals).astype(np.float32))
    return TrueThing(NYU40_NAMES[parts[int(np.argmax(areas))].label], cloud, sum(areas))


def shown(things: Sequence[TrueThing], standing: Sequence[PosedView], gone: Sequence[PosedView]) -> set[int]:
    """Which of them one pass shows and the other one looks through."""
    kept = set()
    for i, thing in enumerate(things):
        here, there = Transparency(thing.cloud), Transparency(thing.cloud)
        for view in standing:
            here.add(view)
        for view in gone:
            there.add(view)
        area = thing.area_m2 * float(np.mean(here.met & there.free))
        print(
            f"  {thing.name} at {thing.cloud.points.mean(axis=0).round(2)}: {area:.3f} m2 of {thing.area_m2:.2f} shown"
        )
        if area >= MIN_AREA:
            kept.add(i)
    return kept


def changes(directory: Path) -> None:
    """Precision and recall of the changes between a run's two passes."""
    saved = open_saved(directory)
    dataset = saved.dataset
    assert isinstance(dataset, SyntheticDataset)
    start = float(np.array(dataset.timestamps)[dataset.second_pass].min())
    found = find_changes(saved.between(-np.inf, start), saved.between(start, np.inf))
    T = fit_alignment(associate(saved.run.keyframes, dataset.ground_truth)).T
    stamps = dataset.ground_truth.timestamps
    exact = [
        PosedView(v.keyframe, v.frame, dataset.ground_truth.poses[np.searchsorted(stamps, v.frame.timestamp)])
        for v in saved.read()
    ]
    first, second = [v for v in exact if v.frame.timestamp < start], [v for v in exact if v.frame.timestamp >= start]
    scenes = [dataset.surfaces(moved) for moved in (False, True)]
    print(f"\n{directory}: the second pass begins at {start:.1f} s; true changes:")
    true = {"gone": things_only_in(scenes[0], scenes[1]), "new": things_only_in(scenes[1], scenes[0])}
    wanted = {("gone", i) for i in shown(true["gone"], first, second)}
    wanted |= {("new", i) for i in shown(true["new"], second, first)}
    claims = [(side, thing) for c in found for side, thing in (("gone", c.before), ("new", c.after)) if thing]
    right, hit = 0, set()
    print("found:")
    for side, thing in claims:
        place = T[:3, :3] @ thing.centroid + T[:3, 3]
        matches = [i for i, t in enumerate(true[side]) if t.holds(place)]
        right += bool(matches)
        hit |= {(side, i) for i in matches}
        names = ", ".join(true[side][i].name for i in matches) or "nothing"
        print(f"  {side} {thing.name} at {place.round(2)}, {thing.area_m2:.2f} m2: {names}")
    print(f"precision {right} of {len(claims)}, recall {len(hit & wanted)} of {len(wanted)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("labels", "changes"):
        commands.add_parser(name).add_argument("runs", nargs="+", type=Path)
    arguments = parser.parse_args()
    for directory in arguments.runs:
        {"labels": labels, "changes": changes}[arguments.command](directory)


if __name__ == "__main__":
    main()
