"""Crops of a map around a robot as three levels: along the axes of the map, and turned with the robot at several scales.

A crop at scale s shows s x s cells of the map as one, by their greatest log-odds: occupied where any is, else unknown where
any is, else free. Such pooled maps are kept beside the map and brought up to date where it has changed, so that a crop reads no
more cells than it shows. The pooled cells that the turned crop can touch are copied into a small patch, and each cell of the crop
is looked up there.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels import Array, bytes_at, int8_at, int8_grid_at, kernel
from lidarium.mapping.occupancy import FREE, OCCUPIED, UNKNOWN, WORD

_FREE, _UNKNOWN, _OCCUPIED = np.uint8(FREE), np.uint8(UNKNOWN), np.uint8(OCCUPIED)

BLOCK = 32
"""Cells that are taken at a time: loops of a fixed length leave no remainder to go through one by one."""

NO_WORD = 2**30
"""Low end of the words of a row of which none has changed."""

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


def untouched(rows: int) -> NDArray[np.int32]:
    """Return the words of each row of a map that have changed, low end and high end (exclusive), where none have: (rows, 2)."""
    return np.tile(np.array([NO_WORD, 0], np.int32), (rows, 1))


@kernel
def forget_touched(touched: Array) -> None:
    """Take all changes of a map (rows, 2) as known."""
    for row in range(touched.shape[0]):
        touched[row, 0], touched[row, 1] = NO_WORD, 0


@kernel
def pool_touched(log_odds: Array, touched: Array, scale: int, pooled: Array) -> None:
    """Bring a pooled map up to date where the map has changed.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map; columns a multiple of 64.
    touched : (rows, 2) int32
        Words of 64 cells of each row that have changed, low end and high end (exclusive), see ``untouched``.
    scale : int
        Side of a pooled cell [cells of the map].
    pooled : (ceil(rows / scale), ceil(columns / scale)) int8
        Greatest log-odds of the cells of each pooled cell; what a pooled cell has beyond the map counts as unknown.
    """
    rows, columns = log_odds.shape
    for row in range(pooled.shape[0]):
        first_row, last_row = row * scale, min((row + 1) * scale, rows)
        low, high = NO_WORD, 0
        for map_row in range(first_row, last_row):
            low, high = min(low, touched[map_row, 0]), max(high, touched[map_row, 1])
        if low >= high:
            continue
        first, last = low * WORD // scale, min((high * WORD + scale - 1) // scale, pooled.shape[1])
        width = (last - first) * scale
        inside = min(width, columns - first * scale)
        greatest = np.empty(width, np.int8)
        greatest[:] = np.int8(-128) if first_row + scale <= rows else np.int8(0)
        greatest[inside:] = np.int8(0)
        target = int8_at(greatest.ctypes.data, inside)
        for map_row in range(first_row, last_row):
            source = int8_at(log_odds.ctypes.data + map_row * columns + first * scale, inside)
            for j in range(inside):
                target[j] = max(target[j], source[j])
        _pool_neighbours(greatest, scale, pooled[row, first:last])


@kernel
def crop_turned(pools: Array, x: float, y: float, heading: float, scales: Array, crops: Array) -> None:
    """Fill crops that are turned with a robot, as levels; unknown outside of the map.

    Rows of a crop go to the robot's left, columns forward; the robot is at the centre. The crop turns about the corner of
    the pooled cells that is nearest to the robot, so that at headings along the axes a crop is exactly the pooled cells around
    that corner, turned by quarters. In between, a cell of the crop shows the pooled cell in which its centre lies.

    Parameters
    ----------
    pools : (scales, 3) int64
        Address, rows and columns of the pooled map of each scale; at scale 1 the map itself.
    x, y : float
        Where the robot is [cells of the map].
    heading : float
        Where it looks in the map [rad].
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
        row, column = int(math.floor(y / scales[k] + 0.5)), int(math.floor(x / scales[k] + 0.5))
        _copy_levels(int8_grid_at(pools[k, 0], pools[k, 1], pools[k, 2]), row - half, column - half, spans, patch)
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
def _copy_levels(pooled: Array, first_row: int, first_column: int, spans: Array, patch: Array) -> None:
    """Fill the spans of a patch (rows * width) with the levels of a pooled map from (first_row, first_column) on."""
    (rows, columns), width = pooled.shape, patch.size // spans.shape[0]
    inside_low, inside_high = min(max(0, -first_column), width), max(min(width, columns - first_column), 0)
    for row in range(spans.shape[0]):
        low, high, map_row = spans[row, 0], spans[row, 1], first_row + row
        if map_row < 0 or map_row >= rows or low < inside_low or high > inside_high:
            patch[row * width + low : row * width + high] = _UNKNOWN
            low, high = max(low, inside_low), min(high, inside_high)
        if 0 <= map_row < rows and low < high:
            target = bytes_at(patch.ctypes.data + row * width + low, high - low)
            source = int8_at(pooled.ctypes.data + map_row * columns + first_column + low, high - low)
            for j in range(high - low):
                target[j] = _level(source[j])


@kernel
def _pool_neighbours(values: Array, scale: int, pooled: Array) -> None:
    """Write the greatest of every ``scale`` neighbours."""
    while scale % 2 == 0 and scale > 1:
        # Groups of two and four are compared many at a time, others one by one.
        group = 4 if scale % 4 == 0 else 2
        scale //= group
        reduced = np.empty(pooled.size * scale, np.int8)
        if group == 4:
            for j in range(reduced.size):
                reduced[j] = max(max(values[4 * j], values[4 * j + 1]), max(values[4 * j + 2], values[4 * j + 3]))
        else:
            for j in range(reduced.size):
                reduced[j] = max(values[2 * j], values[2 * j + 1])
        values = reduced
    if scale == 1:
        for j in range(pooled.size):
            pooled[j] = values[j]
        return
    for j in range(pooled.size):
        greatest = values[j * scale]
        for k in range(1, scale):
            greatest = max(greatest, values[j * scale + k])
        pooled[j] = greatest


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
