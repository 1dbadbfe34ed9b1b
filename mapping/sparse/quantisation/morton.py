"""The Morton order of points: what is near in it is near in space."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

CELLS = 256
"""Cells an axis."""

_DIGIT = 12
"""Bits that a pass sorts by; a key has two digits."""


def _spread_bits() -> NDArray[np.uint32]:
    """Return the bits of each cell's number, two places apart, (CELLS,)."""
    cells = np.arange(CELLS, dtype=np.uint32)
    spread = np.zeros(CELLS, np.uint32)
    for bit in range(8):
        spread |= (cells >> np.uint32(bit) & np.uint32(1)) << np.uint32(3 * bit)
    return spread


SPREAD = _spread_bits()


@kernel
def morton_order(points: Array, low: Array, per_metre: float, spread: Array) -> Array:
    """Return the places of points in Morton order, of equal cells the first first.

    Parameters
    ----------
    points : (N, 3) float32
        The points [m].
    low : (3,) float64
        Corner of the first cell [m]; points beyond the cells count to the outermost ones.
    per_metre : float
        Cells of a metre.
    spread : (CELLS,) uint32
        ``SPREAD``.

    Returns
    -------
    (N,) int32
        The places.
    """
    count, buckets = len(points), 1 << _DIGIT
    keys = np.empty(count, np.uint32)
    starts = np.zeros((2, buckets), np.int32)
    last = np.float32(CELLS - 1)
    scale, zero = np.float32(per_metre), np.float32(0.0)
    x0, y0, z0 = np.float32(low[0]), np.float32(low[1]), np.float32(low[2])
    for i in range(count):
        x = int(min(max((points[i, 0] - x0) * scale, zero), last))
        y = int(min(max((points[i, 1] - y0) * scale, zero), last))
        z = int(min(max((points[i, 2] - z0) * scale, zero), last))
        key = spread[x] | spread[y] << np.uint32(1) | spread[z] << np.uint32(2)
        keys[i] = key
        starts[0, key & np.uint32(buckets - 1)] += 1
        starts[1, key >> np.uint32(_DIGIT)] += 1
    for digit in range(2):
        place = 0
        for bucket in range(buckets):
            found = starts[digit, bucket]
            starts[digit, bucket] = place
            place += found
    halfway, order = np.empty(count, np.int32), np.empty(count, np.int32)
    for i in range(count):
        bucket = keys[i] & np.uint32(buckets - 1)
        halfway[starts[0, bucket]] = i
        starts[0, bucket] += 1
    for j in range(count):
        i = halfway[j]
        bucket = keys[i] >> np.uint32(_DIGIT)
        order[starts[1, bucket]] = i
        starts[1, bucket] += 1
    return order
