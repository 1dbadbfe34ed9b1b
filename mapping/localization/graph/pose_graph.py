"""Poses that agree best with the measurements between them.

They are found by least squares on sparse matrices.

Minimises the sum over the edges of ``rho(e^T W e)``, e the difference of the pose of b as seen from a from
what was measured, W its information; rho is the identity for motions, and Cauchy's for closures, of which one
may be wrong.

Steps solve sparse symmetric systems of 3 x 3 blocks, one row and column of blocks per pose, by a Cholesky
factor. The order of elimination and the blocks that the factor fills depend only on which poses are joined;
they are found once for all steps, by SuperLU's minimum degree. The factors are computed in kernels.

References
----------
Grisetti et al., A tutorial on graph-based SLAM (IEEE ITS Magazine 2010).
Davis, Direct Methods for Sparse Linear Systems (SIAM 2006), chapter 4: the left-looking factorisation.
"""

import math
from typing import NamedTuple

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel


class _Elimination(NamedTuple):
    """Layout of the blocks of a factor, column by column in the order of elimination.

    Attributes
    ----------
    turn : (poses,) int64
        When each pose is eliminated: its row and column.
    starts : (poses + 1,) int64
        Index of each column's first block, which is on the diagonal.
    rows : (blocks,) int64
        Row of each block, ascending within a column, none above the diagonal.
    row_starts : (poses + 1,) int64
        Index of each row's first entry in the next two.
    row_blocks, row_columns : (blocks,) int64
        Number and column of each block, row by row; the last of a row is the diagonal's.
    """

    turn: NDArray[np.int64]
    starts: NDArray[np.int64]
    rows: NDArray[np.int64]
    row_starts: NDArray[np.int64]
    row_blocks: NDArray[np.int64]
    row_columns: NDArray[np.int64]


def _elimination(count: int, a: NDArray[np.int64], b: NDArray[np.int64]) -> _Elimination:
    """Return the factor's blocks if poses are joined by pairs.

    The order of elimination fills few of them.

    Parameters
    ----------
    count : int
        How many poses, at least 1.
    a, b : (pairs,) int64
        Numbers of the poses of each pair, from 0 on, two different ones; a pair may come more than once.
    """
    # Diagonally dominant, and negative beside the diagonal: nothing that is filled cancels out, so its factor
    # has all blocks.
    poses, joins = np.arange(count), -np.ones(len(a))
    diagonal = np.bincount(a, minlength=count) + np.bincount(b, minlength=count) + 1.0
    positions = np.concatenate([a, b, poses]), np.concatenate([b, a, poses])
    dominant = scipy.sparse.csc_matrix((np.concatenate([joins, joins, diagonal]), positions), shape=(count, count))
    factors = scipy.sparse.linalg.splu(
        dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    lower = factors.L
    lower.sort_indices()
    starts, rows = lower.indptr.astype(np.int64), lower.indices.astype(np.int64)
    columns = np.repeat(poses, np.diff(starts))
    by_row = np.lexsort((columns, rows))
    row_starts = np.searchsorted(rows[by_row], np.arange(count + 1))
    return _Elimination(factors.perm_c.astype(np.int64), starts, rows, row_starts, by_row, columns[by_row])


@kernel
def _factorise(places: _Elimination, blocks: Array) -> bool:
    """Replace the lower triangle of a matrix by that of its factor L.

    The matrix is L L^T.

    Parameters
    ----------
    places : Elimination
        Layout of its blocks.
    blocks : (blocks, 3, 3) float64
        The blocks, zero if only the factor has any; changed. Of those on the diagonal only the lower
        triangle is read.
    """
    starts, rows = places.starts, places.rows
    count = len(starts) - 1
    column = np.zeros((count, 3, 3))
    for j in range(count):
        for block in range(starts[j], starts[j + 1]):
            column[rows[block]] = blocks[block]
        for entry in range(places.row_starts[j], places.row_starts[j + 1] - 1):
            first, end = places.row_blocks[entry], starts[places.row_columns[entry] + 1]
            for block in range(first, end):
                _subtract_product(column[rows[block]], blocks[block], blocks[first])
        diagonal = blocks[starts[j]]
        if not _factorise_block(column[j], diagonal):
            return False
        for block in range(starts[j] + 1, starts[j + 1]):
            _divide(column[rows[block]], diagonal, blocks[block])
    return True


@kernel
def _solve(places: _Elimination, factor: Array, right: Array) -> Array:
    """Return the solution (poses, 3) of a factorised matrix for a right side.

    The right side is (poses, 3), both float64 and in the poses' order.
    """
    starts, rows = places.starts, places.rows
    count = len(starts) - 1
    solution = np.empty((count, 3))
    for pose in range(count):
        solution[places.turn[pose]] = right[pose]
    for j in range(count):
        diagonal, own = factor[starts[j]], solution[j]
        for i in range(3):
            for k in range(i):
                own[i] -= diagonal[i, k] * own[k]
            own[i] /= diagonal[i, i]
        for block in range(starts[j] + 1, starts[j + 1]):
            for i in range(3):
                for k in range(3):
                    solution[rows[block], i] -= factor[block, i, k] * own[k]
    for j in range(count - 1, -1, -1):
        diagonal, own = factor[starts[j]], solution[j]
        for block in range(starts[j] + 1, starts[j + 1]):
            for i in range(3):
                for k in range(3):
                    own[k] -= factor[block, i, k] * solution[rows[block], i]
        for i in range(2, -1, -1):
            for k in range(i + 1, 3):
                own[i] -= diagonal[k, i] * own[k]
            own[i] /= diagonal[i, i]
    return solution[places.turn]


@kernel(forceinline=True)
def _subtract_product(of: Array, left: Array, right: Array) -> None:
    """Subtract left right^T from a block."""
    for i in range(3):
        for k in range(3):
            of[i, k] -= left[i, 0] * right[k, 0] + left[i, 1] * right[k, 1] + left[i, 2] * right[k, 2]


@kernel(forceinline=True)
def _factorise_block(block: Array, factor: Array) -> bool:
    """Write the factor of a block on the diagonal; return whether it has one."""
    factor[:] = 0.0
    for i in range(3):
        for k in range(i + 1):
            rest = block[i, k]
            for m in range(k):
                rest -= factor[i, m] * factor[k, m]
            if k < i:
                factor[i, k] = rest / factor[k, k]
            elif rest > 0.0:
                factor[i, i] = math.sqrt(rest)
            else:
                return False
    return True


@kernel(forceinline=True)
def _divide(block: Array, diagonal: Array, quotient: Array) -> None:
    """Write the block that, times the diagonal's transposed factor, gives a block."""
    for i in range(3):
        for k in range(3):
            rest = block[i, k]
            for m in range(k):
                rest -= quotient[i, m] * diagonal[k, m]
            quotient[i, k] = rest / diagonal[k, k]


class Edges(NamedTuple):
    """Measurements between poses.

    Attributes
    ----------
    a, b : (edges,) int64
        Numbers of the poses.
    measured : (edges, 3) float64
        Pose b as seen from pose a: x, y, theta [m, rad].
    information : (edges, 3, 3) float64
        How well, in the frame of a.
    is_robust : (edges,) bool
        Whether the edge may be wrong.
    """

    a: NDArray[np.int64]
    b: NDArray[np.int64]
    measured: NDArray[np.float64]
    information: NDArray[np.float64]
    is_robust: NDArray[np.bool_]


def optimised(
    poses: NDArray[np.float64], edges: Edges, robust_scale: float, iterations: int, newest: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the poses that agree best with the edges, and the last's covariance.

    The first pose is kept.

    Parameters
    ----------
    poses : (poses, 3) float64
        Initial poses: x, y, theta [m, rad]; every pose but the first is joined with the first by edges.
    edges : Edges
        Measurements.
    robust_scale : float
        Residual, in standard deviations, from which on an edge that may be wrong counts less.
    iterations : int
        Maximum number of steps for each scale, at least 1.
    newest : int
        Number of the last edges, which have not been used yet. If they pull hard, they count fully at first,
        and measurements that others contradict lose weight gradually.

    Returns
    -------
    (poses, 3) float64
        The poses; those given if no step makes them better.
    (3, 3) float64
        Covariance of the last pose against the first [m^2, m rad, rad^2].
    """
    if len(poses) < 2:
        return poses.copy(), np.zeros((3, 3))
    # The first pose stays where it is: the unknowns are those of all others.
    is_free = (edges.a > 0) & (edges.b > 0)
    places = _elimination(len(poses) - 1, edges.a[is_free] - 1, edges.b[is_free] - 1)
    factor = np.empty((len(places.rows), 3, 3))
    best = poses.copy()
    pull = _squares(best, edges)[len(edges.a) - newest :]
    scale = max(robust_scale, math.sqrt(float(pull.max())) if len(pull) else 0.0)
    while True:
        best, is_current = _settled(best, edges, scale, iterations, places, factor)
        if scale <= robust_scale:
            break
        scale = max(0.2 * scale, robust_scale)
    if not is_current:
        _normal_equations(best, edges, robust_scale, places, factor)
        _factorise(places, factor)
    best[:, 2] = math.pi - (math.pi - best[:, 2]) % (2.0 * math.pi)
    return best, _last_covariance(places, factor)


@kernel
def residuals(poses: Array, edges: Edges) -> Array:
    """Return the residuals of the edges, (edges, 3) float64 [m, rad].

    By how much b relative to a differs from the measurement; poses are (poses, 3) float64.
    """
    rest = np.empty((len(edges.a), 3))
    for k in range(len(edges.a)):
        a, b = poses[edges.a[k]], poses[edges.b[k]]
        x, y, turned = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        cosine, sine = math.cos(a[2]), math.sin(a[2])
        rest[k, 0] = cosine * x + sine * y - edges.measured[k, 0]
        rest[k, 1] = cosine * y - sine * x - edges.measured[k, 1]
        rest[k, 2] = math.pi - (math.pi - turned + edges.measured[k, 2]) % (2.0 * math.pi)
    return rest


@kernel
def _squares(poses: Array, edges: Edges) -> Array:
    """Return ``e^T W e`` of each edge, shape (edges,) float64."""
    rest = residuals(poses, edges)
    squares = np.zeros(len(rest))
    for k in range(len(rest)):
        for i in range(3):
            for j in range(3):
                squares[k] += rest[k, i] * edges.information[k, i, j] * rest[k, j]
    return squares


@kernel
def _cost(poses: Array, edges: Edges, robust_scale: float) -> float:
    scale, squares = robust_scale * robust_scale, _squares(poses, edges)
    total = 0.0
    for k in range(len(squares)):
        total += scale * math.log1p(squares[k] / scale) if edges.is_robust[k] else squares[k]
    return total


@kernel
def _settled(
    poses: Array, edges: Edges, robust_scale: float, iterations: int, places: _Elimination, factor: Array
) -> tuple[Array, bool]:
    """Return the poses of least cost near given ones.

    By Levenberg and Marquardt's method. The factor of the last Hessian is written; False is returned with them if it
    is that of a step that was rejected, and so much damped.
    """
    best, cost = poses, _cost(poses, edges, robust_scale)
    damping, step = 1e-9, 0
    while True:
        step += 1
        gradient = _normal_equations(best, edges, robust_scale, places, factor)
        for j in range(len(gradient)):
            for i in range(3):
                factor[places.starts[j], i, i] *= 1.0 + damping
        trial, trial_cost = best.copy(), np.inf
        if _factorise(places, factor):
            trial[1:] -= _solve(places, factor, gradient)
            trial_cost = _cost(trial, edges, robust_scale)
        if trial_cost <= cost:
            gain = cost - trial_cost
            best, cost, damping = trial, trial_cost, max(0.1 * damping, 1e-9)
            is_over = gain < 3e-3 * cost + 1e-9
        else:
            damping = max(100.0 * damping, 1e-4)
            is_over = damping > 1e6
        if is_over or step >= iterations:
            return best, damping < 1e-4


@kernel
def _normal_equations(poses: Array, edges: Edges, robust_scale: float, places: _Elimination, hessian: Array) -> Array:
    """Return the gradient (poses - 1, 3) and write the Hessian's lower triangle.

    The gradient is float64, for all poses but the first. The Hessian is written in blocks.
    """
    rest, squares = residuals(poses, edges), _squares(poses, edges)
    gradient = np.zeros((len(poses) - 1, 3))
    hessian[:] = 0.0
    jacobians, weighted = np.zeros((2, 3, 3)), np.zeros((2, 3, 3))
    for edge in range(len(rest)):
        ends = edges.a[edge] - 1, edges.b[edge] - 1
        weight = 1.0 / (1.0 + squares[edge] / (robust_scale * robust_scale)) if edges.is_robust[edge] else 1.0
        _write_jacobians(poses[edges.a[edge]], poses[edges.b[edge]], jacobians)
        for end in range(2):
            for i in range(3):
                for j in range(3):
                    weighted[end, i, j] = 0.0
                    for k in range(3):
                        weighted[end, i, j] += weight * jacobians[end, k, i] * edges.information[edge, k, j]
                    if ends[end] >= 0:
                        gradient[ends[end], i] += weighted[end, i, j] * rest[edge, j]
        for row in range(2):
            for column in range(2):
                if ends[row] >= 0 and ends[column] >= 0 and places.turn[ends[row]] >= places.turn[ends[column]]:
                    block = places.starts[places.turn[ends[column]]]
                    while places.rows[block] != places.turn[ends[row]]:
                        block += 1
                    for i in range(3):
                        for j in range(3):
                            for k in range(3):
                                hessian[block, i, j] += weighted[row, i, k] * jacobians[column, k, j]
    return gradient


@kernel(forceinline=True)
def _write_jacobians(a: Array, b: Array, jacobians: Array) -> None:
    """Write the derivatives (2, 3, 3) of an edge's residual by poses a and b."""
    cosine, sine = math.cos(a[2]), math.sin(a[2])
    x, y = b[0] - a[0], b[1] - a[1]
    before, after = jacobians[0], jacobians[1]
    after[0, 0], after[0, 1], after[1, 0], after[1, 1], after[2, 2] = cosine, sine, -sine, cosine, 1.0
    for i in range(3):
        for j in range(3):
            before[i, j] = -after[i, j]
    before[0, 2], before[1, 2] = cosine * y - sine * x, -cosine * x - sine * y


def _last_covariance(places: _Elimination, factor: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance of the last pose, of the factor of the last Hessian."""
    covariance = np.empty((3, 3))
    for k in range(3):
        right = np.zeros((len(places.turn), 3))
        right[-1, k] = 1.0
        covariance[:, k] = _solve(places, factor, right)[-1]
    return np.asarray(0.5 * (covariance + covariance.T))
