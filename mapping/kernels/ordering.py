"""Sorting in kernels. Numba's own ``np.argsort`` and ``np.sort`` take seconds to compile for each type of numbers."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel


@kernel
def stable_order(values: Array) -> NDArray[np.int64]:
    """Return the indices, (n,) int64, that sort ``values`` (n,), as ``np.argsort(values, kind="stable")`` does.

    Runs of doubling length are merged (merge sort from the bottom up). There must be no nan.
    """
    count = values.shape[0]
    order, merged = np.arange(count), np.empty(count, np.int64)
    length = 1
    while length < count:
        for low in range(0, count, 2 * length):
            middle, high = min(low + length, count), min(low + 2 * length, count)
            i, j = low, middle
            for k in range(low, high):
                if j >= high or (i < middle and values[order[i]] <= values[order[j]]):
                    merged[k] = order[i]
                    i += 1
                else:
                    merged[k] = order[j]
                    j += 1
        order, merged = merged, order
        length *= 2
    return order
