"""Blocks of 8 x 8 cells of a rotated crop, computed at once.

Cells are looked up within registers where the processor can do that.

However a block is turned, the cells that it shows lie within 11 rows and 11 columns of the map: few enough to
be held in registers, from which AVX-512 VBMI picks 64 bytes by their places in two instructions. Other
processors look up cell by cell (``map_crops.turn_by_cells``), which gives the same.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from lidarium.mapping.grids.cell_blocks import fetch_block
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.grids.pooled_maps import POOL, POOL_COLUMNS, POOL_ROWS
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.processor import has_feature
from lidarium.mapping.kernels.views import LINE, scratch_grid, scratch_vector, vector_at

SIDE = 8
"""Side of a block [cells]."""

ROWS, COLUMNS = 12, 16
"""Rows and columns of the map that a block loads.

It shows cells of the first 11 each.
"""

_CELLS = SIDE * SIDE
_BYTE, _INT, _LONG = ir.IntType(8), ir.IntType(32), ir.IntType(64)
_PIECE, _REGISTER, _INTS = (
    ir.VectorType(_BYTE, COLUMNS),
    ir.VectorType(_BYTE, _CELLS),
    ir.VectorType(_INT, _CELLS),
)
_ROWS_OF_BLOCK = ir.VectorType(_LONG, SIDE)
_ALL_UNKNOWN = np.uint64(UNKNOWN * 0x0101010101010101)
PLACES = 16
"""Binary places of the numbers by which cells are looked up."""


def _constant(kind: Any, value: int) -> Any:  # noqa: ANN401
    return ir.Constant(kind, [value] * kind.count)


def _lanes(*places: int) -> Any:  # noqa: ANN401
    return ir.Constant(ir.VectorType(_INT, len(places)), list(places))


def _address(builder: Any, address: Any, kind: Any) -> Any:  # noqa: ANN401
    return builder.inttoptr(address, kind.as_pointer())


def _call(builder: Any, name: str, *vectors: Any) -> Any:  # noqa: ANN401
    """Call one of the processor's functions of registers of bytes."""
    insert: Any = cgutils.get_or_insert_function
    kind = ir.FunctionType(_REGISTER, [_REGISTER] * len(vectors))
    return builder.call(insert(builder.module, kind, f"llvm.x86.avx512.{name}.qi.512"), list(vectors))


def _spread(builder: Any, value: Any) -> Any:  # noqa: ANN401
    """Repeat a number in the lanes of a block."""
    nothing = ir.Constant(_INTS, ir.Undefined)
    lane = builder.trunc(value, _INT)
    return builder.shuffle_vector(
        builder.insert_element(nothing, lane, ir.Constant(_INT, 0)), nothing, _lanes(*[0] * _CELLS)
    )


def _write_places(typing_context: Any, x: Any, y: Any, first: Any, offsets: Any, places: Any) -> Any:  # noqa: ANN401
    """Write where the cells of a block lie in the rows and columns that it loads."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        x, y, first, offsets_at, places_at = arguments
        offsets = _address(builder, offsets_at, _INTS)
        columns, rows = (
            builder.add(
                builder.load(builder.gep(offsets, [ir.Constant(_INT, axis)]), align=1),
                _spread(builder, value),
            )
            for axis, value in enumerate((x, y))
        )
        column = builder.lshr(columns, _constant(_INTS, PLACES))
        sixteen_rows = builder.and_(
            builder.lshr(rows, _constant(_INTS, PLACES - 4)), _constant(_INTS, -COLUMNS)
        )
        place = builder.sub(builder.add(sixteen_rows, column), _spread(builder, first))
        builder.store(builder.trunc(place, _REGISTER), _address(builder, places_at, _REGISTER), align=1)

    return types.void(*(types.int64,) * 5), generate


def _load_row(builder: Any, address: Any) -> Any:  # noqa: ANN401
    return builder.load(_address(builder, address, _PIECE), align=1)


def _load_some(builder: Any, address: Any, columns: Any) -> Any:  # noqa: ANN401
    """Load the columns of a row whose bits are set, and zeros for the others.

    Nothing else is read.
    """
    insert: Any = cgutils.get_or_insert_function
    pointer, mask = (
        _address(builder, address, _PIECE),
        builder.bitcast(columns, ir.VectorType(ir.IntType(1), COLUMNS)),
    )
    kind = ir.FunctionType(_PIECE, [pointer.type, _INT, mask.type, _PIECE])
    function = insert(builder.module, kind, f"llvm.masked.load.v{COLUMNS}i8.p0")
    return builder.call(function, [pointer, ir.Constant(_INT, 1), mask, _constant(_PIECE, 0)])


def _store_levels(builder: Any, rows: list[Any], places_at: Any, crop_at: Any, side: Any) -> None:  # noqa: ANN401
    """Write a block of a crop from loaded rows, by its cells' places in them."""
    registers = rows
    while len(registers) > ROWS * COLUMNS // _CELLS:
        joined = _lanes(*range(2 * registers[0].type.count))
        registers = [
            builder.shuffle_vector(*registers[k : k + 2], joined) for k in range(0, len(registers), 2)
        ]
    first, second, third = registers
    place = builder.load(_address(builder, places_at, _REGISTER), align=1)
    near, far = _call(builder, "vpermi2var", first, place, second), _call(builder, "permvar", third, place)
    # The highest bit of a place tells whether it lies in the third register; the picks do not look at it.
    zero, occupied, unknown, free = (_constant(_REGISTER, value) for value in (0, OCCUPIED, UNKNOWN, FREE))
    log_odds = builder.select(builder.icmp_signed("<", place, zero), far, near)
    known = builder.select(builder.icmp_signed(">", log_odds, zero), occupied, unknown)
    levels = builder.bitcast(
        builder.select(builder.icmp_signed("<", log_odds, zero), free, known), _ROWS_OF_BLOCK
    )
    for row in range(SIDE):
        builder.store(
            builder.extract_element(levels, ir.Constant(_INT, row)),
            _address(builder, crop_at, _LONG),
            align=1,
        )
        crop_at = builder.add(crop_at, side)


def _write_block(typing_context: Any, log_odds: Any, stride: Any, places: Any, crop: Any, side: Any) -> Any:  # noqa: ANN401
    """Write a block that loads cells of the map only."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        row_at, stride, *where = arguments
        rows = []
        for _ in range(ROWS):
            rows.append(_load_row(builder, row_at))
            row_at = builder.add(row_at, stride)
        _store_levels(builder, rows, *where)

    return types.void(*(types.int64,) * 5), generate


def _write_border(
    typing_context: Any,  # noqa: ANN401
    log_odds: Any,  # noqa: ANN401
    stride: Any,  # noqa: ANN401
    cells: Any,  # noqa: ANN401
    places: Any,  # noqa: ANN401
    crop: Any,  # noqa: ANN401
    side: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Write a block that loads only those cells whose bits are set.

    Bits are uint16 for each row; the other cells are unknown.
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        row_at, stride, cells_at, *where = arguments
        rows = []
        for row in range(ROWS):
            pointer = builder.gep(_address(builder, cells_at, ir.IntType(COLUMNS)), [ir.Constant(_INT, row)])
            rows.append(_load_some(builder, row_at, builder.load(pointer, align=1)))
            row_at = builder.add(row_at, stride)
        _store_levels(builder, rows, *where)

    return types.void(*(types.int64,) * 6), generate


CAN_LOOK_UP_IN_REGISTERS = has_feature("avx512vbmi")
"""Whether the processor can do this."""

_places_of_block: Any = intrinsic(_write_places)
_block: Any = intrinsic(_write_block)
_border: Any = intrinsic(_write_border)


@kernel(borrowing=True)
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
    offsets = scratch_grid(2, _CELLS, np.int32)
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
            _places_of_block(
                x, y, row * COLUMNS + column, offsets.ctypes.data, places.ctypes.data + block * _CELLS
            )


@kernel(inline=True, borrowing=True)
def _fill(crop: int, side: int) -> None:
    """Write a block at an address that lies beyond the map."""
    for row in range(SIDE):
        vector_at(crop + row * side, 1, np.uint64)[0] = _ALL_UNKNOWN


@kernel(inline=True)
def _bits_within(first: int, count: int, size: int) -> np.uint16:
    """Return the bits of those of ``count`` indices that lie within a size.

    The indices count from ``first`` on; the size is that of the indexed object.
    """
    low, high = min(max(-first, 0), count), max(min(size - first, count), 0)
    return np.uint16((1 << high) - (1 << low))


@kernel(inline=True, borrowing=True)
def _fetch_patch(pool: Array, corner: Array, half: int) -> None:
    """Begin to load the part of a pooled map that a crop touches."""
    rows, columns = pool[1], pool[2]
    first, last = max(corner[1], 0), min(corner[1] + 2 * half, columns)
    for row in range(max(corner[0], 0), min(corner[0] + 2 * half, rows)):
        for column in range(first, last, LINE):
            fetch_block(pool[0] + row * columns + column)


@kernel(borrowing=True)
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
        scratch_grid(blocks * blocks, _CELLS, np.uint8),
    )
    _write_all_places(half, side, step_x, step_y, loads, places)
    inside = scratch_vector(ROWS, np.uint16)
    for k in range(pools.shape[0]):
        rows, columns = pools[k, POOL_ROWS], pools[k, POOL_COLUMNS]
        for block in range(blocks * blocks):
            row, column = corners[k, 0] + loads[block, 0], corners[k, 1] + loads[block, 1]
            source, where = pools[k, POOL] + row * columns + column, places.ctypes.data + block * _CELLS
            target = (
                crops.ctypes.data + k * side * side + block // blocks * SIDE * side + block % blocks * SIDE
            )
            # A crop was written two steps ago and has left the caches since: begin to load a row of the
            # blocks after these.
            fetch_block(target + (SIDE + block % blocks) * side)
            if row >= 0 and column >= 0 and row + ROWS <= rows and column + COLUMNS <= columns:
                _block(source, columns, where, target, side)
            elif row + ROWS <= 0 or column + COLUMNS <= 0 or row >= rows or column >= columns:
                _fill(target, side)
            else:
                inside[:] = np.uint16(0)
                inside[max(-row, 0) : min(rows - row, ROWS)] = _bits_within(column, COLUMNS, columns)
                _border(source, columns, inside.ctypes.data, where, target, side)
