"""Crops of a map around a robot as three levels, aligned with the map or rotated with the robot.

A crop at scale s shows s x s cells of the map as one, by their maximum log-odds: occupied if any is, else
unknown if any is, else free. Such pooled maps are kept next to the map and updated if it has changed, so
that a crop reads only the cells that it shows.

A rotated crop is computed by blocks of 8 x 8 cells in registers: at any angle, the cells of a block lie
within 11 rows and 11 columns of the map, from which AVX-512 VBMI picks 64 bytes by index in two
instructions. On other processors the pooled cells that the crop can touch are copied into a small patch, and
looked up there cell by cell, with the same result.
"""

import math

import numpy as np

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.grids.pooled_maps import POOL, POOL_COLUMNS, POOL_ROWS
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.llvm import BLOCK
from lidarium.mapping.kernels.simd.cells import HALF_BLOCK, block_of_levels, half_block_of_levels, prefetch
from lidarium.mapping.kernels.simd.crops import (
    CAN_LOOK_UP_IN_REGISTERS,
    CELLS,
    COLUMNS,
    PLACES,
    ROWS,
    SIDE,
    write_block,
    write_border,
    write_indices,
)
from lidarium.mapping.kernels.views import LINE, grid_at, scratch_grid, scratch_vector, vector_at

_ALL_UNKNOWN = np.uint64(UNKNOWN * 0x0101010101010101)


@kernel(nrt=False)
def _write_all_indices(half: int, cells: int, step_x: int, step_y: int, corners: Array, indices: Array) -> None:
    """Compute the part of a patch (2 * ``half`` rows) that each block of a crop loads, and its cells there.

    Parameters
    ----------
    corners : (blocks, 2) int64
        Result: first row and column of the patch that each block loads.
    indices : (blocks, 64) uint8
        Result: 16 * row + column of each cell in the cells that its block loads.
    """
    offsets = scratch_grid(2, CELLS, np.int32)
    for i in range(SIDE):
        for j in range(SIDE):
            offsets[0, i * SIDE + j], offsets[1, i * SIDE + j] = (
                2 * (j * step_x - i * step_y),
                2 * (j * step_y + i * step_x),
            )
    reach = 2 * (SIDE - 1)
    least_x, least_y = reach * (min(step_x, 0) - max(step_y, 0)), reach * (min(step_y, 0) + min(step_x, 0))
    blocks = cells // SIDE
    for i in range(blocks):
        left = 2 * SIDE * i + 1 - cells
        for j in range(blocks):
            block, forward = i * blocks + j, 2 * SIDE * j + 1 - cells
            x, y = (
                (half << PLACES) + forward * step_x - left * step_y,
                (half << PLACES) + forward * step_y + left * step_x,
            )
            row, column = (y + least_y) >> PLACES, (x + least_x) >> PLACES
            corners[block, 0], corners[block, 1] = row, column
            write_indices(x, y, row * COLUMNS + column, offsets.ctypes.data, indices.ctypes.data + block * CELLS)


@kernel(forceinline=True, nrt=False)
def _fill(crop: int, side: int) -> None:
    """Write a block, at an address, that lies beyond the map."""
    for row in range(SIDE):
        vector_at(crop + row * side, 1, np.uint64)[0] = _ALL_UNKNOWN


@kernel(forceinline=True)
def _bits_within(first: int, count: int, size: int) -> np.uint16:
    """Return the bits of those of ``count`` indices from ``first`` on that are within a size."""
    low, high = min(max(-first, 0), count), max(min(size - first, count), 0)
    return np.uint16((1 << high) - (1 << low))


@kernel(forceinline=True, nrt=False)
def _fetch_patch(pool: Array, corner: Array, half: int) -> None:
    """Begin to load the part of a pooled map that a crop touches."""
    rows, columns = pool[1], pool[2]
    first, last = max(corner[1], 0), min(corner[1] + 2 * half, columns)
    for row in range(max(corner[0], 0), min(corner[0] + 2 * half, rows)):
        for column in range(first, last, LINE):
            prefetch(pool[0] + row * columns + column)


@kernel(nrt=False)
def _turn_blocks(pools: Array, corners: Array, half: int, step_x: int, step_y: int, crops: Array) -> None:
    """Fill rotated crops block by block.

    Parameters
    ----------
    pools : (crops, 3) int64
        Address, rows and columns of the pooled map of each crop (int8).
    corners : (crops, 2) int64
        Row and column of each pooled map at which the patch begins that its crop touches.
    crops : (crops, side, side) uint8
        Result, as levels; side a multiple of ``SIDE``.
    """
    side = crops.shape[1]
    blocks = side // SIDE
    for k in range(pools.shape[0]):
        _fetch_patch(pools[k], corners[k], half)
    loads, indices = (
        scratch_grid(blocks * blocks, 2, np.int64),
        scratch_grid(blocks * blocks, CELLS, np.uint8),
    )
    _write_all_indices(half, side, step_x, step_y, loads, indices)
    inside = scratch_vector(ROWS, np.uint16)
    for k in range(pools.shape[0]):
        rows, columns = pools[k, POOL_ROWS], pools[k, POOL_COLUMNS]
        for block in range(blocks * blocks):
            row, column = corners[k, 0] + loads[block, 0], corners[k, 1] + loads[block, 1]
            source, where = pools[k, POOL] + row * columns + column, indices.ctypes.data + block * CELLS
            target = crops.ctypes.data + k * side * side + block // blocks * SIDE * side + block % blocks * SIDE
            # A crop was written two steps ago and has left the caches since: begin to load a row of the
            # blocks after these.
            prefetch(target + (SIDE + block % blocks) * side)
            if row >= 0 and column >= 0 and row + ROWS <= rows and column + COLUMNS <= columns:
                write_block(source, columns, where, target, side)
            elif row + ROWS <= 0 or column + COLUMNS <= 0 or row >= rows or column >= columns:
                _fill(target, side)
            else:
                inside[:] = np.uint16(0)
                inside[max(-row, 0) : min(rows - row, ROWS)] = _bits_within(column, COLUMNS, columns)
                write_border(source, columns, inside.ctypes.data, where, target, side)


_FREE, _UNKNOWN, _OCCUPIED = np.uint8(FREE), np.uint8(UNKNOWN), np.uint8(OCCUPIED)

HALF_STEP = 32768.0
"""Half a cell in the numbers with 16 binary places by which a crop is looked up.

Integers throughout: crops at headings a quarter turn apart look up the same cells, and sums of steps do not
drift.
"""


@kernel(forceinline=True)
def _level(log_odds: int) -> np.uint8:
    return _FREE if log_odds < 0 else (_OCCUPIED if log_odds > 0 else _UNKNOWN)


@kernel(forceinline=True, nrt=False)
def _write_row(log_odds: int, count: int, levels: int) -> None:
    """Write ``count`` cells from one address on as levels from another on."""
    if count < HALF_BLOCK:
        source, target = vector_at(log_odds, count, np.int8), vector_at(levels, count, np.uint8)
        for j in range(count):
            target[j] = _level(source[j])
        return
    # The last ones may overlap those before: nothing remains to go through one by one.
    if count < BLOCK:
        half_block_of_levels(log_odds, levels)
        half_block_of_levels(log_odds + count - HALF_BLOCK, levels + count - HALF_BLOCK)
        return
    for place in range(0, count - BLOCK, BLOCK):
        block_of_levels(log_odds + place, levels + place)
    block_of_levels(log_odds + count - BLOCK, levels + count - BLOCK)


@kernel(nrt=False)
def crop_levels(log_odds: Array, row: int, column: int, crop: Array) -> None:
    """Copy the cells around (row, column) into ``crop`` (side, side), contiguous, as levels.

    Cells outside of the map are unknown.
    """
    side = crop.shape[0]
    first_row, first_column = row - side // 2, column - side // 2
    rows, columns = log_odds.shape
    low, high = min(max(0, -first_column), side), max(min(side, columns - first_column), 0)
    for i in range(side):
        map_row, target = first_row + i, crop.ctypes.data + i * side
        if map_row < 0 or map_row >= rows or low >= high:
            crop[i, :] = _UNKNOWN
            continue
        if low > 0 or high < side:
            crop[i, :low] = _UNKNOWN
            crop[i, high:] = _UNKNOWN
        _write_row(log_odds.ctypes.data + map_row * columns + first_column + low, high - low, target + low)


@kernel
def turn_by_cells(pools: Array, x: float, y: float, heading: float, scales: Array, crops: Array) -> None:
    """Fill the crops of ``crop_turned`` cell by cell: of any side, on any processor."""
    cells, cosine, sine = crops.shape[1], math.cos(heading), math.sin(heading)
    half = _half_patch(cells, cosine, sine)
    width = (2 * half + HALF_BLOCK - 1) // HALF_BLOCK * HALF_BLOCK
    spans = np.empty((2 * half, 2), np.int64)
    _touched_columns(cells, half, cosine, sine, spans)
    indices = _indices_in_patch(half, width, round(cosine * HALF_STEP), round(sine * HALF_STEP), cells)
    patch = np.empty(2 * half * width, np.uint8)
    for k in range(scales.shape[0]):
        row, column = _nearest_corner(x, y, scales[k])
        _copy_levels(
            grid_at(pools[k, POOL], pools[k, POOL_ROWS], pools[k, POOL_COLUMNS], np.int8),
            row - half,
            column - half,
            spans,
            patch,
        )
        _look_up(patch, indices, crops[k].reshape(cells * cells).view(np.uint32))


@kernel(nrt=False)
def turn_in_registers(pools: Array, x: float, y: float, heading: float, scales: Array, crops: Array) -> None:
    """Fill the crops of ``crop_turned`` by blocks.

    The side must be a multiple of ``SIDE``, and ``CAN_LOOK_UP_IN_REGISTERS`` true.
    """
    cosine, sine = math.cos(heading), math.sin(heading)
    half = _half_patch(crops.shape[1], cosine, sine)
    corners = scratch_grid(scales.shape[0], 2, np.int64)
    for k in range(scales.shape[0]):
        row, column = _nearest_corner(x, y, scales[k])
        corners[k, 0], corners[k, 1] = row - half, column - half
    _turn_blocks(pools, corners, half, round(cosine * HALF_STEP), round(sine * HALF_STEP), crops)


_turn_whole_blocks = turn_in_registers if CAN_LOOK_UP_IN_REGISTERS else turn_by_cells
"""Chosen here, so that no kernel is compiled that the processor cannot run."""


@kernel(forceinline=True)
def _half_patch(cells: int, cosine: float, sine: float) -> int:
    """Return half the rows and columns of the patch that a turned crop touches."""
    return int(math.ceil(0.5 * cells * (abs(cosine) + abs(sine))))


@kernel(forceinline=True)
def _nearest_corner(x: float, y: float, scale: int) -> tuple[int, int]:
    """Return row and column of the corner of pooled cells nearest to a position [cells of the map]."""
    return int(math.floor(y / scale + 0.5)), int(math.floor(x / scale + 0.5))


@kernel
def _look_up(patch: Array, indices: Array, crop: Array) -> None:
    """Write the values of a patch at each of the indices into a crop.

    Four cells are written at a time: a core can load more often than it can store.
    """
    for word in range(crop.size):
        place = 4 * word
        low = np.uint32(patch[indices[place]]) | (np.uint32(patch[indices[place + 1]]) << np.uint32(8))
        high = np.uint32(patch[indices[place + 2]]) | (np.uint32(patch[indices[place + 3]]) << np.uint32(8))
        crop[word] = low | (high << np.uint32(16))


@kernel
def _touched_columns(cells: int, half: int, cosine: float, sine: float, spans: Array) -> None:
    """Find the columns of each row of a patch that the rotated crop covers, (rows, 2).

    They are whole blocks, high ends exclusive.
    """
    # Each pair of parallel sides of the crop bounds the columns of a row; near the axes one of them hardly
    # does.
    along, across = max(abs(cosine), 1e-9), max(abs(sine), 1e-9)
    reach_along, reach_across = 0.5 * (cells + across) / along, 0.5 * (cells + along) / across
    slope_along, slope_across = (
        -math.copysign(sine, sine * cosine) / along,
        math.copysign(cosine, sine * cosine) / across,
    )
    for row in range(spans.shape[0]):
        y = row + 0.5 - half
        middle_along, middle_across = slope_along * y, slope_across * y
        low = max(middle_along - reach_along, middle_across - reach_across, -half)
        high = min(middle_along + reach_along, middle_across + reach_across, half)
        spans[row, 0] = (int(math.floor(low)) + half) // HALF_BLOCK * HALF_BLOCK
        spans[row, 1] = (int(math.ceil(high)) + half + HALF_BLOCK - 1) // HALF_BLOCK * HALF_BLOCK


@kernel
def _copy_levels(pooled: Array, first_row: int, first_column: int, spans: Array, patch: Array) -> None:
    """Fill the spans of a patch (rows * width) with levels of a pooled map.

    Levels begin at (first_row, first_column) of the pooled map.
    """
    (rows, columns), width = pooled.shape, patch.size // spans.shape[0]
    inside_low, inside_high = min(max(0, -first_column), width), max(min(width, columns - first_column), 0)
    for row in range(spans.shape[0]):
        low, high, map_row = spans[row, 0], spans[row, 1], first_row + row
        if map_row < 0 or map_row >= rows or low < inside_low or high > inside_high:
            patch[row * width + low : row * width + high] = _UNKNOWN
            low, high = max(low, inside_low), min(high, inside_high)
        if 0 <= map_row < rows and low < high:
            source = pooled.ctypes.data + map_row * columns + first_column + low
            _write_row(source, high - low, patch.ctypes.data + row * width + low)


@kernel
def _indices_in_patch(half: int, width: int, step_x: int, step_y: int, cells: int) -> Array:
    """Return the index of each crop cell's centre in a patch, (cells * cells,) uint32.

    Indices are row * width + column.
    """
    stride = np.uint32(width)
    forward_x, forward_y = np.empty(cells, np.int32), np.empty(cells, np.int32)
    for j in range(cells):
        forward_x[j] = (half << 16) + (2 * j + 1 - cells) * step_x
        forward_y[j] = (half << 16) + (2 * j + 1 - cells) * step_y
    indices = np.empty((cells, cells), np.uint32)
    for i in range(cells):
        left_x, left_y = np.int32((cells - 1 - 2 * i) * step_y), np.int32((2 * i + 1 - cells) * step_x)
        indices_of_row = indices[i]
        for j in range(cells):
            # The compiler widens sums to 64 bits unless asked otherwise, and goes through half as many at a
            # time.
            x, y = (
                np.uint32(left_x + forward_x[j]) >> np.uint32(16),
                np.uint32(left_y + forward_y[j]) >> np.uint32(16),
            )
            indices_of_row[j] = np.uint32(np.uint32(y) * stride) + np.uint32(x)
    return indices.reshape(cells * cells)


@kernel(nrt=False)
def crop_turned(pools: Array, x: float, y: float, heading: float, scales: Array, crops: Array) -> None:
    """Fill crops that are rotated with a robot, as levels; cells outside of the map are unknown.

    Rows of a crop go to the robot's left, columns forward; the robot is at the centre. The crop turns about the
    corner of the pooled cells that is nearest to the robot, so that at headings along the axes a crop is exactly
    the pooled cells around that corner, turned by quarters. In between, a cell of the crop shows the pooled cell in
    which its centre lies.

    Parameters
    ----------
    pools : (scales, 3) int64
        Address, rows and columns of the pooled map of each scale; at scale 1 the map itself.
    x, y : float
        Position of the robot [cells of the map].
    heading : float
        Its heading in the map [rad].
    scales : (scales,) int64
        Side of a crop's cell [cells of the map].
    crops : (scales, side, side) uint8
        Result: 0 occupied, 127 unknown, 255 free; side an even number.
    """
    if CAN_LOOK_UP_IN_REGISTERS and crops.shape[1] % SIDE == 0:
        _turn_whole_blocks(pools, x, y, heading, scales, crops)
    else:
        turn_by_cells(pools, x, y, heading, scales, crops)
