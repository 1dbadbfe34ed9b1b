"""Blocks of 8 x 8 cells of a rotated crop, computed at once.

Cells are looked up within registers where the processor can do that.

However a block is turned, the cells that it shows lie within 11 rows and 11 columns of the map: few enough to
be held in registers, from which AVX-512 VBMI picks 64 bytes by their places in two instructions. Other
processors look up cell by cell (``map_crops.turn_by_cells``), which gives the same.
"""

import numpy as np

from lidarium.mapping.grids.occupancy import UNKNOWN
from lidarium.mapping.grids.pooled_maps import POOL, POOL_COLUMNS, POOL_ROWS
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.cells import prefetch
from lidarium.mapping.kernels.simd.crops import (
    CELLS,
    COLUMNS,
    PLACES,
    ROWS,
    SIDE,
    write_block,
    write_border,
    write_indices,
)
from lidarium.mapping.kernels.views import LINE, scratch_grid, scratch_vector, vector_at

_ALL_UNKNOWN = np.uint64(UNKNOWN * 0x0101010101010101)


@kernel(nrt=False)
def _write_all_places(half: int, cells: int, step_x: int, step_y: int, corners: Array, places: Array) -> None:
    """Compute the part of a patch each block of a crop loads, and its cells there.

    The patch has 2 * ``half`` rows.

    Parameters
    ----------
    half, cells, step_x, step_y : int
        As for ``turn_blocks``.
    corners : (blocks, 2) int64
        Result: first row and column of the patch that each block loads.
    places : (blocks, 64) uint8
        Result: 16 * row + column of each cell in what its block loads.
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
            write_indices(
                x, y, row * COLUMNS + column, offsets.ctypes.data, places.ctypes.data + block * CELLS
            )


@kernel(forceinline=True, nrt=False)
def _fill(crop: int, side: int) -> None:
    """Write a block at an address that lies beyond the map."""
    for row in range(SIDE):
        vector_at(crop + row * side, 1, np.uint64)[0] = _ALL_UNKNOWN


@kernel(forceinline=True)
def _bits_within(first: int, count: int, size: int) -> np.uint16:
    """Return the bits of those of ``count`` indices that lie within a size.

    The indices count from ``first`` on; the size is that of the indexed object.
    """
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
def turn_blocks(pools: Array, corners: Array, half: int, step_x: int, step_y: int, crops: Array) -> None:
    """Fill crops that are turned, block by block.

    Parameters
    ----------
    pools : (crops, 3) int64
        Address, rows and columns of the pooled map of each crop (int8).
    corners : (crops, 2) int64
        Row and column of each pooled map where the patch begins that its crop touches.
    half : int
        Half the rows and columns of that patch.
    step_x, step_y : int
        How far a crop goes from one cell to the next [2**-15 cells]: to the next column by these, to the next
        row by -step_y, step_x.
    crops : (crops, side, side) uint8
        Written as levels; side a multiple of ``SIDE``.
    """
    side = crops.shape[1]
    blocks = side // SIDE
    for k in range(pools.shape[0]):
        _fetch_patch(pools[k], corners[k], half)
    loads, places = (
        scratch_grid(blocks * blocks, 2, np.int64),
        scratch_grid(blocks * blocks, CELLS, np.uint8),
    )
    _write_all_places(half, side, step_x, step_y, loads, places)
    inside = scratch_vector(ROWS, np.uint16)
    for k in range(pools.shape[0]):
        rows, columns = pools[k, POOL_ROWS], pools[k, POOL_COLUMNS]
        for block in range(blocks * blocks):
            row, column = corners[k, 0] + loads[block, 0], corners[k, 1] + loads[block, 1]
            source, where = pools[k, POOL] + row * columns + column, places.ctypes.data + block * CELLS
            target = (
                crops.ctypes.data + k * side * side + block // blocks * SIDE * side + block % blocks * SIDE
            )
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
