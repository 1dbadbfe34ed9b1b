"""Matrices of a few rows: products, solutions and inverses that are the same to the bit on every processor.

Libraries of linear algebra sum in an order that depends on the processor. An episode of SLAM that differs in the last
bit of one pose ends elsewhere.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

ROTATIONS = 30
"""Maximum number of sweeps of Jacobi's method."""


@kernel
def solved(matrix: Array, right: Array) -> Array:
    """Return the solution of a linear system by elimination with row exchanges.

    Parameters
    ----------
    matrix : (n, n) float64
        The matrix; a singular one gives inf or nan.
    right : (n, k) float64
        The right sides.
    """
    rows, rest = matrix.copy(), right.copy()
    count = rows.shape[0]
    for j in range(count):
        pivot = j
        for i in range(j + 1, count):
            if abs(rows[i, j]) > abs(rows[pivot, j]):
                pivot = i
        if pivot != j:
            for k in range(count):
                rows[j, k], rows[pivot, k] = rows[pivot, k], rows[j, k]
            for k in range(rest.shape[1]):
                rest[j, k], rest[pivot, k] = rest[pivot, k], rest[j, k]
        for i in range(j + 1, count):
            share = rows[i, j] / rows[j, j]
            for k in range(j + 1, count):
                rows[i, k] -= share * rows[j, k]
            for k in range(rest.shape[1]):
                rest[i, k] -= share * rest[j, k]
    for j in range(count - 1, -1, -1):
        for k in range(rest.shape[1]):
            for i in range(j + 1, count):
                rest[j, k] -= rows[j, i] * rest[i, k]
            rest[j, k] /= rows[j, j]
    return rest


@kernel
def squared(matrix: Array, vector: Array) -> float:
    """Return ``v^T M v`` of a matrix (n, n) and a vector (n,)."""
    total = 0.0
    for i in range(len(vector)):
        part = 0.0
        for k in range(len(vector)):
            part += matrix[i, k] * vector[k]
        total += vector[i] * part
    return total


@kernel
def _multiplied(left: Array, right: Array) -> Array:
    """Return the product of two matrices (n, m) and (m, k), summed in order."""
    found = np.zeros((left.shape[0], right.shape[1]))
    for i in range(left.shape[0]):
        for j in range(right.shape[1]):
            for k in range(left.shape[1]):
                found[i, j] += left[i, k] * right[k, j]
    return found


@kernel
def _rotated(matrix: Array, vectors: Array) -> None:
    """Turn a symmetric matrix into the diagonal one of its eigenvalues (Jacobi), and write their vectors as columns."""
    count = matrix.shape[0]
    for _ in range(ROTATIONS):
        rest = 0.0
        for i in range(count):
            for j in range(i):
                rest += abs(matrix[i, j])
        if rest == 0.0:
            return
        for i in range(count):
            for j in range(i):
                if matrix[i, j] == 0.0:
                    continue
                half = 0.5 * (matrix[i, i] - matrix[j, j]) / matrix[i, j]
                tangent = 1.0 / (abs(half) + np.sqrt(half * half + 1.0))
                if half < 0.0:
                    tangent = -tangent
                cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
                sine = tangent * cosine
                for k in range(count):
                    a, b = matrix[k, j], matrix[k, i]
                    matrix[k, j], matrix[k, i] = cosine * a - sine * b, sine * a + cosine * b
                    a, b = vectors[k, j], vectors[k, i]
                    vectors[k, j], vectors[k, i] = cosine * a - sine * b, sine * a + cosine * b
                for k in range(count):
                    a, b = matrix[j, k], matrix[i, k]
                    matrix[j, k], matrix[i, k] = cosine * a - sine * b, sine * a + cosine * b


def _plain(matrix: ArrayLike) -> NDArray[np.float64]:
    """Return a matrix as the kernels take it."""
    return np.ascontiguousarray(matrix, np.float64)


def inverse(matrix: ArrayLike) -> NDArray[np.float64]:
    """Return the inverse of a matrix (n, n)."""
    square = _plain(matrix)
    return np.asarray(solved(square, np.eye(len(square))))


def product(first: ArrayLike, *others: ArrayLike) -> NDArray[np.float64]:
    """Return the product of matrices, from the left to the right; a vector last gives a vector."""
    found = _plain(first)
    for other in others:
        factor = _plain(other)
        found = _multiplied(found, factor[:, None])[:, 0] if factor.ndim == 1 else _multiplied(found, factor)
    return found


def eigenvalues(matrix: ArrayLike) -> NDArray[np.float64]:
    """Return the eigenvalues of a symmetric matrix (n, n), ascending."""
    values = _plain(matrix).copy()
    _rotated(values, np.eye(len(values)))
    return np.sort(np.diag(values))


def pseudo_inverse(matrix: ArrayLike) -> NDArray[np.float64]:
    """Return the pseudo-inverse of a symmetric matrix (n, n); eigenvalues below 1e-15 of the largest count as zero."""
    values, vectors = _plain(matrix).copy(), np.eye(len(np.asarray(matrix)))
    _rotated(values, vectors)
    found = np.diag(values)
    counts = np.abs(found) > 1e-15 * np.abs(found).max(initial=0.0)
    shares = np.divide(1.0, found, out=np.zeros(len(found)), where=counts)
    return product(vectors, np.diag(shares), vectors.T)
