"""Banded systems of equations, as least-squares fits of cubic splines give them.

A symmetric matrix is kept by its lower band, (n, 4): row i holds columns i, i - 1, i - 2, i - 3.
"""

import math

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.splines.curves.basis import ORDER


@kernel
def factorize(band: Array) -> bool:
    """Replace a banded matrix by its Cholesky factor, band for band.

    Return False where it is not positive definite.
    """
    for i in range(band.shape[0]):
        for back in range(min(i, ORDER - 1), -1, -1):
            j = i - back
            value = band[i, back]
            for k in range(max(i - ORDER + 1, j - ORDER + 1, 0), j):
                value -= band[i, i - k] * band[j, j - k]
            if back > 0:
                band[i, back] = value / band[j, 0]
            elif value <= 1e-14 * band[i, 0] or value <= 0.0:
                return False
            else:
                band[i, 0] = math.sqrt(value)
    return True


@kernel
def solve(factor: Array, right: Array) -> None:
    """Solve for all columns of the right side, in place."""
    count = factor.shape[0]
    for column in range(right.shape[1]):
        for i in range(count):
            value = right[i, column]
            for back in range(1, min(i, ORDER - 1) + 1):
                value -= factor[i, back] * right[i - back, column]
            right[i, column] = value / factor[i, 0]
        for i in range(count - 1, -1, -1):
            value = right[i, column]
            for ahead in range(1, min(count - 1 - i, ORDER - 1) + 1):
                value -= factor[i + ahead, ahead] * right[i + ahead, column]
            right[i, column] = value / factor[i, 0]
