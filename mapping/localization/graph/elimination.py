"""Cholesky factor of a sparse symmetric matrix of 3 x 3 blocks.

It has one row and column of blocks per pose of a graph.

In which order poses are best eliminated, and which blocks the factor then fills, depends on who is joined
with whom only. It is found once for all steps of a least-squares problem, by SuperLU's minimum degree; the
factors are computed in kernels.

References
----------
Davis, Direct Methods for Sparse Linear Systems (SIAM 2006), chapter 4: the left-looking factorisation.
"""

import math
from typing import NamedTuple

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel


class Elimination(NamedTuple):
    """Where the blocks of a factor are, column by column in the order of elimination.

    Attributes
    ----------
    turn : (poses,) int64
        When each pose is eliminated: its row and column.
    starts : (poses + 1,) int64
        Where each column's blocks begin; the first of a column is the diagonal's.
    rows : (blocks,) int64
        Row of each block, ascending within a column, none above the diagonal.
    row_starts : (poses + 1,) int64
        Where each row begins in the two below.
    row_blocks, row_columns : (blocks,) int64
        Number and column of each block, row by row; the last of a row is the diagonal's.
    """

    turn: NDArray[np.int64]
    starts: NDArray[np.int64]
    rows: NDArray[np.int64]
    row_starts: NDArray[np.int64]
    row_blocks: NDArray[np.int64]
    row_columns: NDArray[np.int64]


def elimination(count: int, a: NDArray[np.int64], b: NDArray[np.int64]) -> Elimination:
    """Return the factor's blocks where poses are joined by pairs.

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
    places = np.concatenate([a, b, poses]), np.concatenate([b, a, poses])
    dominant = scipy.sparse.csc_matrix(
        (np.concatenate([joins, joins, diagonal]), places), shape=(count, count)
    )
    factors = scipy.sparse.linalg.splu(
        dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    lower = factors.L
    lower.sort_indices()
    starts, rows = lower.indptr.astype(np.int64), lower.indices.astype(np.int64)
    columns = np.repeat(poses, np.diff(starts))
    by_row = np.lexsort((columns, rows))
    row_starts = np.searchsorted(rows[by_row], np.arange(count + 1))
    return Elimination(factors.perm_c.astype(np.int64), starts, rows, row_starts, by_row, columns[by_row])


@kernel
def factorise(places: Elimination, blocks: Array) -> bool:
    """Replace the lower triangle of a matrix by that of its factor L.

    The matrix is L L^T.

    Parameters
    ----------
    places : Elimination
        Where its blocks are.
    blocks : (blocks, 3, 3) float64
        The blocks, zero where only the factor has any; changed. Of those on the diagonal only the lower
        triangle is read.

    Returns
    -------
    bool
        Whether there is a factor: the matrix is positive definite. Where there is none, the blocks are of no
        use.
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
def solve(places: Elimination, factor: Array, right: Array) -> Array:
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
