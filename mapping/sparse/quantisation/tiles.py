"""Points sorted into tiles along the Morton curve, with bounds."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.codes import TILE

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
def _morton_order(points: Array, low: Array, per_metre: float, spread: Array) -> Array:
    """Return the places of points in Morton order, of equal cells the first first.

    Parameters
    ----------
    points : (N, 3) float32
        The points [m].
    low : (3,) float64
        Corner of the first cell [m]; points beyond the cells count to the outermost ones.
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


GROUP = 16
"""Tiles of a group."""

FARTHEST = 1e6
"""Largest coordinate [m]."""

_SPREADS = 4.0
"""Standard deviations from the mean to the outermost cells: stray points do not make cells large."""


class Tiles(NamedTuple):
    """Points in Morton order, cut into tiles; the last one is filled up with its last point, weight 0.

    Attributes
    ----------
    points : (tiles, 3, TILE) float32
        Coordinates [m].
    weights : (tiles, TILE) float32
        Weights.
    sums : (tiles, 4) float64
        Sums of the weighted coordinates, and of the weights.
    boxes : (tiles, 2, 3) float32
        Least and greatest coordinates of a tile [m].
    group_boxes : (groups, 2, 3) float32
        Those of a group.
    order : (N,) int32
        Places of the points in the caller's order.
    """

    points: NDArray[np.float32]
    weights: NDArray[np.float32]
    sums: NDArray[np.float64]
    boxes: NDArray[np.float32]
    group_boxes: NDArray[np.float32]
    order: NDArray[np.int32]


def tiles_of(points: NDArray[np.float32], weights: NDArray[np.float32] | None = None) -> Tiles:
    """Cut points into tiles.

    Parameters
    ----------
    points : (N, 3) float32
        The points [m].
    weights : (N,) float32, optional
        Their weights, all 1 by default.
    """
    totals, ends = _extent_of(points)
    if not (np.isfinite(totals).all() and np.abs(ends).max() <= FARTHEST):
        raise ValueError(
            f"points reach from {ends[0].tolist()} to {ends[1].tolist()}; want finite coordinates of at most "
            f"{FARTHEST:,.0f} m"
        )
    mean = totals[0] / len(points)
    reach = _SPREADS * np.sqrt(np.maximum(totals[1] / len(points) - mean * mean, 0.0))
    low, high = np.maximum(ends[0], mean - reach), np.minimum(ends[1], mean + reach)
    edge = max(float((high - low).max()), 1e-6)
    order = _morton_order(points, low, CELLS / edge, SPREAD)
    given = np.empty(0, np.float32) if weights is None else weights
    count = math.ceil(len(points) / TILE)
    sides, masses, sums, boxes = _fill_tiles(points, given, order, count)
    return Tiles(sides, masses, sums, boxes, _group_boxes(boxes), order)


@kernel
def _extent_of(points: Array) -> tuple[Array, Array]:
    """Return sums of coordinates and of squares, least and greatest ones, (2, 3)."""
    totals, ends = np.zeros((2, 3)), np.empty((2, 3))
    for axis in range(3):
        total, squares = 0.0, 0.0
        low = high = points[0, axis]
        for i in range(len(points)):
            value = points[i, axis]
            total += value
            squares += float(value) * float(value)
            low, high = min(low, value), max(high, value)
        totals[0, axis], totals[1, axis], ends[0, axis], ends[1, axis] = total, squares, low, high
    return totals, ends


@kernel
def _fill_tiles(points: Array, weights: Array, order: Array, count: int) -> tuple[Array, Array, Array, Array]:
    """Return points, weights, sums and boxes of tiles."""
    sides, masses = np.empty((count, 3, TILE), np.float32), np.empty((count, TILE), np.float32)
    sums, boxes = np.zeros((count, 4)), np.empty((count, 2, 3), np.float32)
    for tile in range(count):
        for lane in range(TILE):
            place = tile * TILE + lane
            i = order[min(place, len(order) - 1)]
            mass = np.float32(1.0) if len(weights) == 0 else weights[i]
            if place >= len(order):
                mass = np.float32(0.0)
            masses[tile, lane] = mass
            for axis in range(3):
                sides[tile, axis, lane] = points[i, axis]
        _sum_tile(sides[tile], masses[tile], sums[tile], boxes[tile])
    return sides, masses, sums, boxes


@kernel(forceinline=True)
def _sum_tile(sides: Array, masses: Array, sums: Array, box: Array) -> None:
    """Set the sums and the box of a tile, three axes side by side."""
    x_low = x_high = sides[0, 0]
    y_low = y_high = sides[1, 0]
    z_low = z_high = sides[2, 0]
    a, b, c, total = 0.0, 0.0, 0.0, 0.0
    for lane in range(TILE):
        x, y, z, mass = sides[0, lane], sides[1, lane], sides[2, lane], float(masses[lane])
        x_low, y_low, z_low = min(x_low, x), min(y_low, y), min(z_low, z)
        x_high, y_high, z_high = max(x_high, x), max(y_high, y), max(z_high, z)
        a, b, c, total = a + mass * float(x), b + mass * float(y), c + mass * float(z), total + mass
    box[0, 0], box[0, 1], box[0, 2] = x_low, y_low, z_low
    box[1, 0], box[1, 1], box[1, 2] = x_high, y_high, z_high
    sums[0], sums[1], sums[2], sums[3] = a, b, c, total


@kernel
def _group_boxes(boxes: Array) -> Array:
    """Return the boxes of groups, (groups, 2, 3) float32."""
    count = (len(boxes) + GROUP - 1) // GROUP
    groups = np.empty((count, 2, 3), np.float32)
    for group in range(count):
        for axis in range(3):
            low, high = boxes[group * GROUP, 0, axis], boxes[group * GROUP, 1, axis]
            for tile in range(group * GROUP, min((group + 1) * GROUP, len(boxes))):
                low, high = min(low, boxes[tile, 0, axis]), max(high, boxes[tile, 1, axis])
            groups[group, 0, axis], groups[group, 1, axis] = low, high
    return groups
