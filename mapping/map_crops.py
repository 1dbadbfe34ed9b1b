"""Crops of a map around a robot as three levels: along the axes of the map, and turned with the robot at several scales.

A crop at scale s shows s x s cells of the map as one, by their greatest log-odds: occupied where any is, else unknown where
any is, else free. It is made in two passes: the cells along the axes that the turned crop can touch are pooled row by row
into a small patch, which reads the map as it lies in memory; then each cell of the crop is looked up in the patch.
"""

import math

import numpy as np

from lidarium.mapping.kernels import Array, int8_at, kernel
from lidarium.mapping.occupancy import FREE, OCCUPIED, UNKNOWN

_FREE, _UNKNOWN, _OCCUPIED = np.uint8(FREE), np.uint8(UNKNOWN), np.uint8(OCCUPIED)

SLAB = 32
"""Rows of a patch that are pooled at a time."""

BLOCK = 32
"""Cells that are pooled at a time: loops of a fixed length leave no remainder to go through one by one."""

HALF_STEP = 32768.0
"""Half a cell in the numbers with 16 binary places by which a crop is looked up."""


@kernel(inline=True)
def _level(log_odds: int) -> np.uint8:
    return _FREE if log_odds < 0 else (_OCCUPIED if log_odds > 0 else _UNKNOWN)


@kernel
def crop_levels(log_odds: Array, row: int, column: int, crop: Array) -> None:
    """Copy the cells around (row, column) into ``crop`` (side, side) as levels; unknown outside of the map."""
    side = crop.shape[0]
    first_row, first_column = row - side // 2, column - side // 2
    rows, columns = log_odds.shape
    low, high = min(max(0, -first_column), side), max(min(side, columns - first_column), 0)
    for i in range(side):
        target = crop[i]
        map_row = first_row + i
        if map_row < 0 or map_row >= rows or low >= high:
            target[:] = _UNKNOWN
            continue
        target[:low] = _UNKNOWN
        target[high:] = _UNKNOWN
        source, inner = log_odds[map_row, first_column + low : first_column + high], target[low:high]
        for j in range(high - low):
            inner[j] = _level(source[j])


@kernel
def crop_turned(log_odds: Array, row: int, column: int, heading: float, scales: Array, crops: Array) -> None:
    """Fill crops that are turned with a robot, as levels; unknown outside of the map.

    Rows of a crop go to the robot's left, columns forward; the robot is at the centre. The crop turns about the corner of
    the map's cells that is nearest to the robot, in which also the pooled cells begin, so that at headings along the axes
    a crop is exactly the cells around that corner, turned by quarters. In between, a cell of the crop shows the pooled cell
    in which its centre lies.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map.
    row, column : int
        The corner about which to turn: the lower left one of that cell.
    heading : float
        Where the robot looks in the map [rad].
    scales : (scales,) int64
        Side of a crop's cell [cells of the map].
    crops : (scales, side, side) uint8
        Written: 0 occupied, 127 unknown, 255 free; side an even number.
    """
    cells = crops.shape[1]
    cosine, sine = math.cos(heading), math.sin(heading)
    half = int(math.ceil(0.5 * cells * (abs(cosine) + abs(sine))))
    width = (2 * half + BLOCK - 1) // BLOCK * BLOCK
    spans = np.empty((2 * half, 2), np.int64)
    _touched_columns(cells, half, cosine, sine, spans)
    places = _places(half, width, cosine, sine, cells)
    patch = np.empty(2 * half * width, np.uint8)
    for k in range(scales.shape[0]):
        scale = scales[k]
        _pool(log_odds, row - half * scale, column - half * scale, scale, spans, patch)
        crop = crops[k].reshape(cells * cells)
        for place in range(places.size):
            crop[place] = patch[places[place]]


@kernel
def _touched_columns(cells: int, half: int, cosine: float, sine: float, spans: Array) -> None:
    """Tell which columns of each row of a patch the turned crop covers, in whole blocks: (rows, 2), high ends exclusive."""
    # Each pair of parallel sides of the crop bounds the columns of a row; near the axes one of them hardly does.
    along, across = max(abs(cosine), 1e-9), max(abs(sine), 1e-9)
    reach_along, reach_across = 0.5 * (cells + across) / along, 0.5 * (cells + along) / across
    slope_along, slope_across = -math.copysign(sine, sine * cosine) / along, math.copysign(cosine, sine * cosine) / across
    for row in range(spans.shape[0]):
        y = row + 0.5 - half
        middle_along, middle_across = slope_along * y, slope_across * y
        low = max(middle_along - reach_along, middle_across - reach_across, -half)
        high = min(middle_along + reach_along, middle_across + reach_across, half)
        spans[row, 0] = (int(math.floor(low)) + half) // BLOCK * BLOCK
        spans[row, 1] = (int(math.ceil(high)) + half + BLOCK - 1) // BLOCK * BLOCK


@kernel
def _pool(log_odds: Array, first_row: int, first_column: int, scale: int, spans: Array, patch: Array) -> None:
    """Fill the spans of a patch (rows * width) with the levels of scale x scale cells each, from (first_row, first_column) on."""
    width = patch.size // spans.shape[0]
    # A few rows at a time, which stay in the processor's nearest cache from one pass to the next.
    pooled = np.empty((SLAB, width * scale), np.int8)
    if first_column < 0 or first_column + width * scale > log_odds.shape[1]:
        pooled[:] = np.int8(0)
    # Rows of the patch that touch the map.
    inside_low = min(max(-first_row // scale, 0), spans.shape[0])
    inside_high = max(min((log_odds.shape[0] - first_row + scale - 1) // scale, spans.shape[0]), inside_low)
    patch[: inside_low * width] = _UNKNOWN
    patch[inside_high * width :] = _UNKNOWN
    for low in range(inside_low, inside_high, SLAB):
        high = min(low + SLAB, inside_high)
        _pool_rows(log_odds, first_row + low * scale, first_column, scale, spans[low:high], pooled)
        _pool_columns(pooled.reshape(SLAB * width * scale), scale, patch[low * width : high * width])


@kernel
def _pool_rows(log_odds: Array, first_row: int, first_column: int, scale: int, spans: Array, pooled: Array) -> None:
    """Write the greatest of every ``scale`` rows of the map into the rows of ``pooled``, in the columns that are in the map."""
    (rows, columns), width = log_odds.shape, pooled.shape[1]
    inside_low, inside_high = min(max(0, -first_column), width), max(min(width, columns - first_column), 0)
    for row in range(spans.shape[0]):
        low, high = max(spans[row, 0] * scale, inside_low), min(spans[row, 1] * scale, inside_high)
        if low >= high:
            continue
        size = high - low
        target, start = int8_at(pooled.ctypes.data + row * width + low, size), log_odds.ctypes.data + first_column + low
        map_row, last = first_row + row * scale, first_row + (row + 1) * scale - 1
        least = np.int8(0) if map_row < 0 or last >= rows else np.int8(-128)
        map_row, last = max(map_row, 0), min(last, rows - 1)
        first = int8_at(start + map_row * columns, size)
        for j in range(size):
            target[j] = max(least, first[j])
        # Three rows at a time save writing; the last one counts again where fewer are left.
        for k in range(map_row + 1, last + 1, 3):
            first, second = int8_at(start + k * columns, size), int8_at(start + min(k + 1, last) * columns, size)
            third = int8_at(start + min(k + 2, last) * columns, size)
            for j in range(size):
                target[j] = max(target[j], max(first[j], max(second[j], third[j])))


@kernel
def _pool_columns(values: Array, scale: int, levels: Array) -> None:
    """Write the levels of the greatest of every ``scale`` neighbours."""
    while scale % 2 == 0:
        # Groups of two and four are compared many at a time, others one by one.
        group = 4 if scale % 4 == 0 else 2
        scale //= group
        reduced = np.empty(levels.size * scale, np.int8)
        if group == 4:
            for j in range(reduced.size):
                reduced[j] = max(max(values[4 * j], values[4 * j + 1]), max(values[4 * j + 2], values[4 * j + 3]))
        else:
            for j in range(reduced.size):
                reduced[j] = max(values[2 * j], values[2 * j + 1])
        values = reduced
    if scale > 1:
        reduced = np.empty(levels.size, np.int8)
        for j in range(reduced.size):
            greatest = values[j * scale]
            for k in range(1, scale):
                greatest = max(greatest, values[j * scale + k])
            reduced[j] = greatest
        values = reduced
    for j in range(levels.size):
        levels[j] = _level(values[j])


@kernel
def _places(half: int, width: int, cosine: float, sine: float, cells: int) -> Array:
    """Return where in a patch, row * width + column, the centre of each cell of the crop lies: (cells * cells,) uint32."""
    # Whole numbers throughout: crops at headings a quarter apart look up the same cells, and no sum of steps drifts.
    step_x, step_y, stride = round(cosine * HALF_STEP), round(sine * HALF_STEP), np.uint32(width)
    forward_x, forward_y = np.empty(cells, np.int32), np.empty(cells, np.int32)
    for j in range(cells):
        forward_x[j] = (half << 16) + (2 * j + 1 - cells) * step_x
        forward_y[j] = (half << 16) + (2 * j + 1 - cells) * step_y
    places = np.empty((cells, cells), np.uint32)
    for i in range(cells):
        left_x, left_y = np.int32((cells - 1 - 2 * i) * step_y), np.int32((2 * i + 1 - cells) * step_x)
        places_of_row = places[i]
        for j in range(cells):
            # The compiler widens sums to 64 bits unless told otherwise, and goes through half as many at a time.
            x, y = np.uint32(left_x + forward_x[j]) >> np.uint32(16), np.uint32(left_y + forward_y[j]) >> np.uint32(16)
            places_of_row[j] = np.uint32(np.uint32(y) * stride) + np.uint32(x)
    return places.reshape(cells * cells)
