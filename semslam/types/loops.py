"""A loop from its proposal to its verification."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Self

from semslam.types.arrays import Covariance6, IntArray, Transform


@dataclass(frozen=True, slots=True)
class NodePair:
    """Two semantic nodes that were matched.

    Attributes:
        label: class name.
        query_uvd: u, v in pixels and depth in metres in the query.
        match_uvd: the same in the match.
    """

    label: str
    query_uvd: tuple[float, float, float]
    match_uvd: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class ObjectPair:
    """Two objects of submaps that were matched.

    Attributes:
        label: name of the classes.
        query_xyz: centroid in the camera frame of the candidate's query, metres.
        match_xyz: the same in its match's.
    """

    label: str
    query_xyz: tuple[float, float, float]
    match_xyz: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class LoopEvidence:
    """What made a detector propose a pair.

    Attributes:
        labels: class names both frames share.
        nodes: matched semantic nodes.
        figures: named scores that went into the decision.
        objects: matched objects of the submaps.
    """

    labels: tuple[str, ...] = ()
    nodes: tuple[NodePair, ...] = ()
    figures: dict[str, float] = field(default_factory=dict)
    objects: tuple[ObjectPair, ...] = ()

    @classmethod
    def from_plain(cls, values: dict[str, Any]) -> Self:
        """The reverse of ``dataclasses.asdict`` and JSON."""
        return cls(
            tuple(values["labels"]),
            tuple(NodePair(v["label"], tuple(v["query_uvd"]), tuple(v["match_uvd"])) for v in values["nodes"]),
            values["figures"],
            tuple(
                ObjectPair(v["label"], tuple(v["query_xyz"]), tuple(v["match_xyz"])) for v in values.get("objects", ())
            ),
        )


@dataclass(frozen=True, slots=True)
class SubmapGuess:
    """A relative pose that a detector found between two submaps, the surroundings of the two keyframes.

    Attributes:
        T_match_query: rows of the (4, 4) pose of the query's camera in the match's.
        query: ids of the keyframes whose clouds make the query's submap.
        match: ids of those of the match's.
    """

    T_match_query: tuple[tuple[float, ...], ...]
    query: tuple[int, ...]
    match: tuple[int, ...]

    @classmethod
    def from_plain(cls, values: dict[str, Any]) -> Self:
        """The reverse of ``dataclasses.asdict`` and JSON."""
        rows = tuple(tuple(row) for row in values["T_match_query"])
        return cls(rows, tuple(values["query"]), tuple(values["match"]))


@dataclass(frozen=True, slots=True)
class LoopCandidate:
    """A pair of keyframes that a detector takes for the same place.

    Attributes:
        query: id of the newer keyframe.
        match: id of the older one.
        score: 0..1, higher is surer.
        detector: registered name of who proposed it.
        evidence: what agreed.
        guess: the relative pose of the surroundings, from a detector that finds one; verification then registers these.
        prediction: (4, 4) T_match_query by earlier loops and odometry, which the verification may begin with, or None.
    """

    query: int
    match: int
    score: float
    detector: str
    evidence: LoopEvidence = LoopEvidence()
    guess: SubmapGuess | None = None
    prediction: Transform | None = field(default=None, compare=False, repr=False)

    @classmethod
    def from_plain(cls, values: dict[str, Any]) -> Self:
        """The reverse of ``dataclasses.asdict`` and JSON."""
        guess = values.get("guess")
        evidence = LoopEvidence.from_plain(values["evidence"])
        return cls(**values | {"evidence": evidence, "guess": guess and SubmapGuess.from_plain(guess)})


@dataclass(frozen=True, slots=True, eq=False)
class LoopConstraint:
    """A verified loop closure.

    Attributes:
        candidate: what was verified.
        T_match_query: (4, 4) pose of the ``query`` keyframe's camera in the ``match`` keyframe's.
        covariance: (6, 6) of T_match_query.
        fitness: share of the query's points that meet the match's surface, 0..1.
        inlier_rmse: metres, of those points.
        overlap: the smaller share of either view that the other one sees, 0..1.
        inliers: feature matches that support the pose.
        method: which estimate was kept, such as "pnp" or "icp".
        figures: what the steps on the way measured, by name.
        shared: (K, 2) int64 rows of the query's and of the match's ``finest`` features that agree, or None.
        between: ids of the query and the match where the verification chose others than the candidate's, as of two
            submaps those whose views have most in common.
    """

    candidate: LoopCandidate
    T_match_query: Transform
    covariance: Covariance6
    fitness: float
    inlier_rmse: float
    overlap: float
    inliers: int
    method: str
    figures: dict[str, float] = field(default_factory=dict)
    shared: IntArray | None = None
    between: tuple[int, int] | None = None

    @property
    def query(self) -> int:
        """Id of the newer keyframe that the pose joins."""
        return self.candidate.query if self.between is None else self.between[0]

    @property
    def match(self) -> int:
        """Id of the older one."""
        return self.candidate.match if self.between is None else self.between[1]


class RejectionReason(StrEnum):
    """Why a candidate did not become a constraint, or a constraint did not stay."""

    REDUNDANT = "redundant"
    FEW_MATCHES = "few_matches"
    FEW_INLIERS = "few_inliers"
    NO_CLOUD = "no_cloud"
    FAR_FROM_GUESS = "far_from_guess"
    LOW_FITNESS = "low_fitness"
    HIGH_RMSE = "high_rmse"
    LOW_OVERLAP = "low_overlap"
    FREE_SPACE = "free_space"
    DEGENERATE = "degenerate"
    INCONSISTENT = "inconsistent"
    AMBIGUOUS = "ambiguous"
    UNSUPPORTED = "unsupported"
    OUTLIER = "outlier"
    SHED = "shed"

    @property
    def is_unverified(self) -> bool:
        """Whether the verification was not asked."""
        return self in (RejectionReason.REDUNDANT, RejectionReason.SHED)


@dataclass(frozen=True, slots=True)
class LoopRejection:
    """A candidate that was refused.

    Attributes:
        candidate: what was refused.
        reason: the test it failed.
        figure: the value that failed.
        limit: the value it should have met.
    """

    candidate: LoopCandidate
    reason: RejectionReason
    figure: float
    limit: float


Verification = LoopConstraint | LoopRejection
"""What the verification makes of a candidate."""
