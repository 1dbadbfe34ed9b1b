"""Blocks of 8 x 8 cells of a turned crop that are looked up in registers.

AVX-512 VBMI picks 64 bytes by their indices in two instructions. Processors without it do not compile this
text: ``grids/map_crops.py`` looks up cell by cell there.
"""

import numpy as np
from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.llvm import (
    INT,
    LONG,
    Builder,
    Value,
    call,
    constant,
    has_feature,
    llvm_overload,
    load_at,
    splat,
    store_at,
    vector,
)
from lidarium.mapping.kernels.simd.cells import LEVELS, levels_of
from lidarium.mapping.kernels.simd.words import cells_of
from lidarium.mapping.kernels.views import grid_at, vector_at

SIDE = 8
"""Side of a block [cells]."""

ROWS, COLUMNS = 12, 16
"""Rows and columns of the map that a block loads; it shows cells of the first 11 of each."""

CELLS = SIDE * SIDE
"""Cells of a block."""

PLACES = 16
"""Binary places of the numbers by which cells are looked up."""

CAN_LOOK_UP_IN_REGISTERS = has_feature("avx512vbmi")
"""Whether the processor can do this."""

_ROW, _REGISTER = vector(ir.IntType(8), COLUMNS), vector(ir.IntType(8), CELLS)
_INTS = vector(INT, CELLS)


def write_indices(x: int, y: int, first: int, offsets: int, indices: int) -> None:
    """Write the indices ``COLUMNS * row + column`` of a block's cells, less ``first``, as 64 uint8.

    Cells lie at x and y plus the (2, 64) int32 offsets [2 ** -PLACES cells].
    """
    columns, rows = (grid_at(offsets, 2, CELLS, np.int32).astype(int) + np.array([[x], [y]])) >> PLACES
    vector_at(indices, CELLS, np.uint8)[:] = (COLUMNS * rows + columns - first).astype(np.uint8)


@llvm_overload(write_indices, types.void, *(types.int64,) * 5)
def _(builder: Builder, x: Value, y: Value, first: Value, offsets: Value, indices: Value) -> Value:
    columns, rows = (
        builder.add(load_at(builder, offsets, _INTS, 4 * CELLS * axis), splat(builder, value, _INTS))
        for axis, value in enumerate((x, y))
    )
    column = builder.lshr(columns, constant(_INTS, PLACES))
    sixteen_rows = builder.and_(builder.lshr(rows, constant(_INTS, PLACES - 4)), constant(_INTS, -COLUMNS))
    index = builder.sub(builder.add(sixteen_rows, column), splat(builder, first, _INTS))
    store_at(builder, builder.trunc(index, _REGISTER), indices)


def write_block(log_odds: int, stride: int, indices: int, crop: int, side: int) -> None:
    """Write a block of a crop, ``side`` cells wide, as levels: the cells of loaded rows at the indices."""
    rows = np.array([vector_at(log_odds + k * stride, COLUMNS, np.int8) for k in range(ROWS)])
    _pick(rows, indices, crop, side)


def write_border(log_odds: int, stride: int, inside: int, indices: int, crop: int, side: int) -> None:
    """Do as ``write_block`` with only those cells loaded whose bits are set in ``inside``, (12,) uint16.

    The other cells are unknown.
    """
    rows = np.zeros((ROWS, COLUMNS), np.int8)
    for k, bits in enumerate(vector_at(inside, ROWS, np.uint16).tolist()):
        for column in np.flatnonzero(cells_of(bits, COLUMNS)).tolist():
            rows[k, column] = vector_at(log_odds + k * stride + column, 1, np.int8)[0]
    _pick(rows, indices, crop, side)


def _pick(rows: np.ndarray, indices: int, crop: int, side: int) -> None:
    signs = np.sign(rows.reshape(-1)[np.array(vector_at(indices, CELLS, np.uint8))])
    levels = np.array(LEVELS, np.uint8)[1 - signs].reshape(SIDE, SIDE)
    for k in range(SIDE):
        vector_at(crop + k * side, SIDE, np.uint8)[:] = levels[k]


@llvm_overload(write_block, types.void, *(types.int64,) * 5)
def _(builder: Builder, log_odds: Value, stride: Value, indices: Value, crop: Value, side: Value) -> Value:
    rows = []
    for _ in range(ROWS):
        rows.append(load_at(builder, log_odds, _ROW))
        log_odds = builder.add(log_odds, stride)
    _store_levels(builder, rows, indices, crop, side)


@llvm_overload(write_border, types.void, *(types.int64,) * 6)
def _(
    builder: Builder, log_odds: Value, stride: Value, inside: Value, indices: Value, crop: Value, side: Value
) -> Value:
    rows = []
    for row in range(ROWS):
        bits = load_at(builder, inside, ir.IntType(COLUMNS), 2 * row)
        mask = builder.bitcast(bits, vector(ir.IntType(1), COLUMNS))
        pointer = builder.inttoptr(log_odds, _ROW.as_pointer())
        name, alignment = f"llvm.masked.load.v{COLUMNS}i8.p0", ir.Constant(INT, 1)
        rows.append(call(builder, name, _ROW, pointer, alignment, mask, constant(_ROW, 0)))
        log_odds = builder.add(log_odds, stride)
    _store_levels(builder, rows, indices, crop, side)


def _store_levels(builder: Builder, rows: list[Value], indices: Value, crop: Value, side: Value) -> None:
    """Write a block of a crop from loaded rows, by its cells' indices in them."""
    registers = rows
    while len(registers) > ROWS * COLUMNS // CELLS:
        count = 2 * registers[0].type.count
        joined = constant(vector(INT, count), *range(count))
        registers = [builder.shuffle_vector(*registers[k : k + 2], joined) for k in range(0, len(registers), 2)]
    first, second, third = registers
    index = load_at(builder, indices, _REGISTER)
    near = call(builder, "llvm.x86.avx512.vpermi2var.qi.512", _REGISTER, first, index, second)
    far = call(builder, "llvm.x86.avx512.permvar.qi.512", _REGISTER, third, index)
    # The highest bit of an index says whether it lies in the third register; the picks ignore it.
    is_far = builder.icmp_signed("<", index, constant(_REGISTER, 0))
    levels = builder.bitcast(levels_of(builder, builder.select(is_far, far, near)), vector(LONG, SIDE))
    for row in range(SIDE):
        store_at(builder, builder.extract_element(levels, ir.Constant(INT, row)), crop)
        crop = builder.add(crop, side)
