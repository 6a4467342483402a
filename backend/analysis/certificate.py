"""Whether poses are the optimum of their graph: a bound below which no poses cost, found by duality.

The cost is chordal: an edge with the rotation R_ij, the translation t_ij, the rotational information Ω and a variance
σ² along each axis costs ||(R_j - R_i R_ij) W^½||² + ||t_j - t_i - R_i t_ij||² / σ², where W = tr(Ω)/2 I - Ω makes it
the squared Mahalanobis distance for small errors. (W is positive as long as no axis is known better than the other two
together.) It is quadratic in the poses' matrices, so that its Lagrangian dual is a semidefinite programme (Rosen et
al., "SE-Sync", IJRR 2019). Multipliers are read off at the poses: where the matrix that they leave is positive
semidefinite, the poses are the global optimum.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from semslam.backend.graph.products import Edge, GraphSolution
from semslam.geometry.se3 import orthonormalise
from semslam.types import FloatArray, Transforms

LARGEST_GAP = 1e-3
"""How much more than the bound poses may cost, as a share of it, to be called the optimum."""
SLACKS = (1e-7, 1e-6, 1e-5, 1e-4)
"""Shares of the cost by which the bound may lie lower to make up for rounding; the first that suffices."""
NEWTON_STEPS, CONVERGED = 10, 1e-9
GENERATORS = np.array(
    [[[0, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 0]], [[0, -1, 0], [1, 0, 0], [0, 0, 0]]]
)


@dataclass(frozen=True, slots=True)
class Certificate:
    """How far poses can be from the optimum.

    Attributes:
        cost: chordal cost of the poses, in squared standard deviations; twice ``GraphSolution.cost`` for small errors.
        bound: no poses cost less; none where the dual gives no bound, as in a local minimum.
    """

    cost: float
    bound: float | None

    @property
    def gap(self) -> float | None:
        """How much less other poses can cost, at most, as a share of the bound (of 1 where the bound is less)."""
        return None if self.bound is None else max(self.cost - self.bound, 0.0) / max(self.bound, 1.0)

    @property
    def certified(self) -> bool:
        """Whether the poses are the optimum but for ``LARGEST_GAP``."""
        return self.gap is not None and self.gap <= LARGEST_GAP


def certify(solution: GraphSolution) -> Certificate:
    """Certify the poses of a solution for odometry and the accepted loops, with the solution's scales applied.

    Directions of translation count alike, correlations with rotation do not count, and the best known axis of rotation
    counts no more than the other two together. Where covariances are far from that, the poses are not the optimum of
    this cost, and the gap is large.
    """
    row = {key: index for index, key in enumerate(solution.poses)}
    edges = solution.widened
    if not edges:
        return Certificate(0.0, 0.0)
    Q = _quadratic_form(edges, row)
    X = np.hstack([T[:3] for T in solution.poses.values()])
    held = [row[component[0]] for component in solution.components]
    return Certificate(_cost(Q, X), _lower_bound(Q, _polished(Q, X, held), held))


def _quadratic_form(edges: Sequence[Edge], row: dict[int, int]) -> sparse.csc_matrix:
    """Q (4N, 4N), for which tr(X Q X') is the cost of poses X = [R_1 t_1 R_2 t_2 ...] (3, 4N)."""
    i, j = np.array([(row[edge.from_key], row[edge.to_key]) for edge in edges]).T
    T = np.stack([edge.T_from_to for edge in edges])
    covariance = np.stack([edge.covariance for edge in edges])
    variances, axes = np.linalg.eigh(covariance[:, :3, :3])
    known = 1.0 / variances  # best first
    known[:, 0] = np.minimum(known[:, 0], known[:, 1] + known[:, 2])
    weights = np.zeros((len(edges), 4, 4))
    weights[:, :3, :3] = (axes * (known.sum(1, keepdims=True) / 2 - known)[:, None]) @ axes.swapaxes(1, 2)
    weights[:, 3, 3] = 3.0 / np.trace(covariance[:, 3:, 3:], axis1=1, axis2=2)
    ahead = T @ weights
    blocks = [(i, i, ahead @ T.swapaxes(1, 2)), (i, j, -ahead), (j, i, -ahead.swapaxes(1, 2)), (j, j, weights)]
    a, b, values = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    return _sparse_blocks(a, b, values, len(row))


def _sparse_blocks(i: FloatArray, j: FloatArray, blocks: FloatArray, count: int) -> sparse.csc_matrix:
    """A matrix of ``count`` blocks each way with blocks (B, H, W) at the places (i, j); those at one place add up."""
    _, height, width = blocks.shape
    rows = np.broadcast_to(height * i[:, None, None] + np.arange(height)[:, None], blocks.shape)
    columns = np.broadcast_to(width * j[:, None, None] + np.arange(width), blocks.shape)
    shape = height * count, width * count
    return sparse.csc_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def _cost(Q: sparse.csc_matrix, X: FloatArray) -> float:
    return float(((Q @ X.T).T * X).sum())


def _dual_matrix(Q: sparse.csc_matrix, X: FloatArray) -> sparse.csc_matrix:
    """Q less the multipliers of the rotations' orthonormality, read off at the poses."""
    count = X.shape[1] // 4
    R, gradient = _poses(X)[:, :, :3], _poses((Q @ X.T).T)[:, :, :3]
    multipliers = np.zeros((count, 4, 4))
    multipliers[:, :3, :3] = R.swapaxes(1, 2) @ gradient
    multipliers = (multipliers + multipliers.swapaxes(1, 2)) / 2
    return (Q - _sparse_blocks(np.arange(count), np.arange(count), multipliers, count)).tocsc()


def _poses(X: FloatArray) -> Transforms:
    """(N, 3, 4) of (3, 4N)."""
    return X.reshape(3, -1, 4).transpose(1, 0, 2)


def _polished(Q: sparse.csc_matrix, X: FloatArray, held: Sequence[int]) -> FloatArray:
    """The critical point of the chordal cost next to the poses, by Newton's method on the manifold."""
    count = X.shape[1] // 4
    free = np.setdiff1d(np.arange(6 * count), [6 * index + axis for index in held for axis in range(6)])
    for _ in range(NEWTON_STEPS if len(free) else 0):
        poses, basis = _poses(X), np.zeros((count, 12, 6))
        moved = poses[:, None, :, :3] @ GENERATORS
        basis[:, :9, :3] = moved.transpose(0, 3, 2, 1).reshape(count, 9, 3)
        basis[:, 9:, 3:] = np.eye(3)
        B = _sparse_blocks(np.arange(count), np.arange(count), basis, count)
        H = (B.T @ sparse.kron(_dual_matrix(Q, X), sparse.eye(3), format="csc") @ B).tocsc()[free][:, free]
        factor = _factorised(H)
        if factor is None:
            break
        step = np.zeros(6 * count)
        step[free] = -factor.solve((B.T @ (Q @ X.T).ravel())[free])
        step = step.reshape(count, 6)
        turned = np.tile(np.eye(4), (count, 1, 1))
        turned[:, :3, :3] = poses[:, :, :3] @ (np.eye(3) + np.tensordot(step[:, :3], GENERATORS, 1))
        turned = orthonormalise(turned)[:, :3]
        turned[:, :, 3] = poses[:, :, 3] + step[:, 3:]
        last, X = X, turned.transpose(1, 0, 2).reshape(3, -1)
        if abs(_cost(Q, last) - _cost(Q, X)) <= CONVERGED * max(_cost(Q, X), 1.0):
            break
    return X


def _lower_bound(Q: sparse.csc_matrix, X: FloatArray, held: Sequence[int]) -> float | None:
    """A cost that no poses fall below.

    Where the dual matrix and η on the diagonal of its rotations are positive semidefinite, rotations of unit norm cost
    at least the trace of the multipliers, which is the cost at X, less η for each of their 3 N rows. One translation of
    each component is nothing but its place in the world and is left out.
    """
    count, cost = X.shape[1] // 4, _cost(Q, X)
    kept = np.setdiff1d(np.arange(4 * count), [4 * index + 3 for index in held])
    S, rotations = _dual_matrix(Q, X), np.tile([1.0, 1.0, 1.0, 0.0], count)
    for slack in SLACKS:
        allowed = slack * max(cost, 1.0)
        shifted = (S + sparse.diags(rotations * allowed / (3 * count))).tocsc()[kept][:, kept]
        factor = _factorised(shifted.tocsc())
        if factor is not None and (factor.U.diagonal() > 0).all() and (factor.perm_r == factor.perm_c).all():
            return cost - allowed
    return None


def _factorised(matrix: sparse.csc_matrix) -> SuperLU | None:
    """LDL' of a symmetric matrix, with D on the diagonal of U; none where it is singular."""
    symmetric = {"SymmetricMode": True}
    try:
        return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
    except RuntimeError:
        return None
