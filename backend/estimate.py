"""Poses that are kept up to date factor by factor: iSAM2 (Kaess et al., IJRR 2012)."""

from collections.abc import Sequence

import gtsam

from semslam.backend.graph.factors import ANCHOR_SIGMA, between_factor, prior_factor, read_poses
from semslam.backend.graph.products import Edge, GraphSolution
from semslam.backend.steps import Steps
from semslam.types import FloatArray, Transform

RELINEARIZE = 0.02
"""Radians and metres a pose must move before its factors are linearised again."""
RELINEARIZE_EVERY = 10
"""Updates between two checks of which poses have moved."""
LOOSE = 10.0
"""Radians and metres: holds a map until its loops come; a looser one leaves the system badly conditioned."""
NEVER = 2**30
SETTLING_BUDGET, SETTLING_STEPS = 3_000, 3
"""Keyframes times linearisations that a loop may cost, and the maximum number of linearisations."""
GROSS = 50.0
"""A loop that raises the error, to first order, by more than this many times the limit is not linearised."""
CHUNK = 500
"""Keyframes of a solution that one step takes in."""

Pair = tuple[int, int]
"""Match and query of a loop."""


class RunningEstimate:
    """Current poses of keyframes; what is placed, held and joined counts from the next ``update``.

    Args:
        exact: whether to factorise by QR, which solves badly conditioned graphs that Cholesky cannot, and takes half
            as long again where a loop comes.

    Attributes:
        loops: the loops that shape the poses, with iSAM2's index of each one's factor.
    """

    def __init__(self, exact: bool = False) -> None:
        params = gtsam.ISAM2Params()
        params.setFactorization("QR" if exact else "CHOLESKY")
        params.setRelinearizeThreshold(RELINEARIZE)
        params.relinearizeSkip = NEVER  # but where it is asked for
        self.loops: dict[Pair, int] = {}
        self._isam = gtsam.ISAM2(params)
        self._factors = gtsam.NonlinearFactorGraph()
        self._values = gtsam.Values()
        self._staged: dict[int, Pair] = {}
        self._updates = self._placed = 0
        self._known_error: float | None = None  # new keyframes start on their odometry and add nothing to it

    def __contains__(self, key: int) -> bool:
        return bool(self._values.exists(key) or self._isam.valueExists(key))

    def place(self, key: int, T_world_cam: Transform) -> None:
        """Give a new keyframe a pose (4, 4) to start from."""
        self._values.insert(key, gtsam.Pose3(T_world_cam))
        self._placed += 1

    def hold(self, key: int, T_world_cam: Transform, sigma: float) -> None:
        """Hold a keyframe at a pose (4, 4) with a standard deviation in radians and metres."""
        self._factors.add(prior_factor(key, T_world_cam, sigma))

    def join(self, edge: Edge, loop: Pair | None = None) -> None:
        """Join two keyframes by a trusted edge, or by a loop that has been found true."""
        if loop is not None:
            self._staged[self._factors.size()] = loop
        self._factors.add(between_factor(edge))

    def update(self) -> None:
        """Take in what was placed, held and joined."""
        self._updates += 1
        anew = self._updates % RELINEARIZE_EVERY == 0
        indices = self._isam.update(self._factors, self._values, force_relinearize=anew).getNewFactorsIndices()
        self._known_error = None if anew or self._staged else self._known_error
        self.loops.update({loop: indices[place] for place, loop in self._staged.items()})
        self._factors, self._values, self._staged = gtsam.NonlinearFactorGraph(), gtsam.Values(), {}

    def admit(self, edge: Edge, loop: Pair, max_residual: float) -> bool:
        """Let a loop shape the poses at once, unless it raises the squared error by more than a true one would.

        Args:
            edge: the loop.
            loop: its match and query.
            max_residual: Mahalanobis distance up to which a loop may be true.
        """
        limit = max_residual**2
        before = self.error() if self._known_error is None else self._known_error
        factors = gtsam.NonlinearFactorGraph()
        factors.add(between_factor(edge))
        (self.loops[loop],) = self._isam.update(factors, gtsam.Values()).getNewFactorsIndices()
        after, moved = self.error(), False
        if limit < 2 * (after - before) <= GROSS * limit:
            moved = self._settle()
            after = self.error()
        if 2 * (after - before) <= limit:
            self._known_error = None if self._settle() else after
            return True
        self._remove(loop)
        self._known_error = None if moved and self._settle() else before
        return False

    def withdraw(self, loop: Pair) -> None:
        """Undo the effect of a loop at once."""
        self._remove(loop)
        self._settle()
        self._known_error = None

    def error(self) -> float:
        """Half the sum of squared residuals; takes time in proportion to the graph."""
        return float(self._isam.getFactorsUnsafe().error(self._isam.calculateEstimate()))

    def pose(self, key: int) -> FloatArray:
        """The current pose (4, 4) of one keyframe."""
        found = self._values if self._values.exists(key) else None
        pose = self._isam.calculateEstimatePose3(key) if found is None else found.atPose3(key)
        T_world_cam: Transform = pose.matrix()
        return T_world_cam

    def poses(self) -> dict[int, Transform]:
        """The poses of all keyframes that an update has taken in."""
        values = self._isam.calculateEstimate()
        return read_poses(values, values.keys())

    def _remove(self, loop: Pair) -> None:
        self._isam.update(gtsam.NonlinearFactorGraph(), gtsam.Values(), [self.loops.pop(loop)])

    def _settle(self) -> bool:
        """Linearise anew where poses moved, as often as the number of keyframes allows; returns whether any had."""
        moved = False
        for _ in range(min(SETTLING_STEPS, SETTLING_BUDGET // max(self._placed, 1))):
            result = self._isam.update(gtsam.NonlinearFactorGraph(), gtsam.Values(), force_relinearize=True)
            if result.getVariablesRelinearized() == 0:
                break
            moved = True
        return moved


def estimate_of(solution: GraphSolution, order: Sequence[int], exact: bool = False) -> Steps[RunningEstimate]:
    """A new estimate that starts as a solution, a chunk of keyframes at each step.

    Args:
        solution: poses and loops to start from.
        order: its keys, as they came.
        exact: see ``RunningEstimate``.
    """
    place = {key: index for index, key in enumerate(order)}
    estimate = RunningEstimate(exact)
    steps: list[list[tuple[Edge, Pair | None]]] = [[] for _ in range(-(-len(order) // CHUNK))]
    widened = solution.widened
    count = len(solution.odometry)
    trusted = [(edge, None) for edge in (*solution.covisible, *widened[:count])]
    loops = [(edge, (edge.from_key, edge.to_key)) for edge in widened[count:]]
    for edge, loop in (*trusted, *loops):
        steps[max(place[edge.from_key], place[edge.to_key]) // CHUNK].append((edge, loop))
    anchors = set(solution.anchors)
    # A map whose loops to others come in a later chunk needs a hold of its own until then.
    led = {max(edge.from_key, edge.to_key, key=place.__getitem__) for edge in solution.odometry}
    for number, edges in enumerate(steps):
        for key in order[number * CHUNK : (number + 1) * CHUNK]:
            estimate.place(key, solution.poses[key])
            if key in anchors or key not in led:
                estimate.hold(key, solution.poses[key], ANCHOR_SIGMA if key in anchors else LOOSE)
        for edge, loop in edges:
            estimate.join(edge, loop)
        estimate.update()
        yield
    return estimate
