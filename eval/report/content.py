"""The content of a run's page, as plain values."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from semslam.eval.report.drawing import RunDrawing
from semslam.eval.report.frames import NO_IMAGES, EmbeddedImages
from semslam.eval.report.verdict import Verdict
from semslam.types import FloatArray


@dataclass(frozen=True, slots=True)
class Fact:
    """A name and its value, as they are printed."""

    name: str
    value: str


@dataclass(frozen=True, slots=True)
class ErrorRow:
    """One error of the trajectories; None where it is not known.

    Attributes:
        name: of the error.
        unit: its unit.
        odometry: of the front end's own trajectory.
        pose_graph: after the pose graph with its loops, before the last adjustment.
        optimised: of the final trajectory.
        comparable: whether odometry's own trajectory has about the same frames as the others.
    """

    name: str
    unit: str
    odometry: float | None
    pose_graph: float | None
    optimised: float | None
    comparable: bool = True

    @property
    def by_loops(self) -> float | None:
        """Relative change by the pose graph."""
        return _change(self.odometry, self.pose_graph) if self.comparable else None

    @property
    def by_adjustment(self) -> float | None:
        """Relative change by the last adjustment."""
        return _change(self.pose_graph, self.optimised)

    @property
    def in_all(self) -> float | None:
        """Relative change from the odometry to the final trajectory."""
        return _change(self.odometry, self.optimised) if self.comparable else None


@dataclass(frozen=True, slots=True)
class StageTime:
    """Median milliseconds of one call of a stage."""

    name: str
    milliseconds: float


@dataclass(frozen=True, slots=True)
class ChangedSetting:
    """A setting that differs from its default, all as they are printed."""

    name: str
    value: str
    default: str


@dataclass(frozen=True, slots=True)
class ObjectRow:
    """An object of the semantic map, as it is printed: class, confidence, place and size in metres, keyframes."""

    name: str
    confidence: float
    centroid: tuple[float, ...]
    extent: tuple[float, ...]
    keyframes: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class SemanticSection:
    """The semantic map on a page: a picture as a data URI, or None, and the objects."""

    picture: str | None
    objects: tuple[ObjectRow, ...]


@dataclass(frozen=True, slots=True, eq=False)
class RunReport:
    """The content of a run's page.

    Attributes:
        verdict: the run in one sentence.
        facts: the tiles at the top.
        errors: rows of the error table; empty without ground truth.
        drawing: trajectories and all loop candidates.
        images: of the candidates' keyframes.
        semantic: the semantic map, where one was made.
        inliers: (K, 4) pixels u, v in the query and u, v in the match, by position of the candidate.
        stages: where the time goes.
        resources: time and memory of the whole run.
        changes: settings that differ from their defaults.
        origin: version, commit, command line and the like, as far as the run knows them.
        notes: what was repaired or left out, a sentence each.
        settings: all settings as YAML.
    """

    verdict: Verdict
    facts: tuple[Fact, ...]
    errors: tuple[ErrorRow, ...]
    drawing: RunDrawing
    images: EmbeddedImages = NO_IMAGES
    semantic: SemanticSection | None = None
    inliers: Mapping[int, FloatArray] = field(default_factory=dict)
    stages: tuple[StageTime, ...] = ()
    resources: tuple[Fact, ...] = ()
    changes: tuple[ChangedSetting, ...] = ()
    origin: tuple[Fact, ...] = ()
    notes: tuple[str, ...] = ()
    settings: str = ""


def _change(before: float | None, after: float | None) -> float | None:
    return None if before is None or after is None or before == 0 else after / before - 1
