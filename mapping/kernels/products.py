"""Products of small matrices, each number summed in one order.

The order of sums in BLAS depends on the processor. Its threads also busy-wait for each other when other programs use
the cores: with two busy cores, networks of explorers took four times the processor time.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import kernel


@kernel
def product(left: NDArray[np.float32], right: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the product of two matrices, (n, m) float32; zeros of the left one cost nothing.

    Parameters
    ----------
    left : (n, k) float32
        First matrix.
    right : (k, m) float32, contiguous
        Second matrix.
    """
    rows, inner, columns = left.shape[0], left.shape[1], right.shape[1]
    found = np.zeros((rows, columns), np.float32)
    terms = np.empty(inner, np.int64)
    for row in range(rows):
        count = 0
        for k in range(inner):
            terms[count] = k
            count += left[row, k] != 0.0
        # Four terms at once read and write each sum a quarter as often.
        for first in range(0, count - 3, 4):
            a, b, c, d = terms[first], terms[first + 1], terms[first + 2], terms[first + 3]
            by_a, by_b, by_c, by_d = left[row, a], left[row, b], left[row, c], left[row, d]
            for column in range(columns):
                total = found[row, column] + by_a * right[a, column]
                total = (total + by_b * right[b, column]) + by_c * right[c, column]
                found[row, column] = total + by_d * right[d, column]
        for k in terms[count - count % 4 : count]:
            for column in range(columns):
                found[row, column] += left[row, k] * right[k, column]
    return found
