"""The unknown area in view of a cell, along 32 rays at once.

Cells are loaded one by one: processors that mend their gathers load them no faster together.
"""

import numpy as np
from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.llvm import (
    INT,
    Builder,
    Value,
    any_of,
    call,
    constant,
    for_range,
    llvm_overload,
    load_at,
    splat,
    stack_slot,
    vector,
)
from lidarium.mapping.kernels.views import grid_at, vector_at

RAYS = 32
"""Rays at once."""

_GROUP = 16
_INTS, _BYTES, _FLAGS = (vector(ir.IntType(bits), _GROUP) for bits in (32, 8, 1))


def unknown_in_view(cell: int, offsets: int, steps: int, most: int) -> int:
    """Return the sum of the steps at which each ray meets unknown cells, until it meets an occupied one.

    Parameters
    ----------
    cell : int
        Address of a cell of the map, int8: > 0 occupied, 0 unknown, < 0 free.
    offsets : int
        Address of the offsets from the cell, (steps, RAYS) int32, of the cells that each ray meets.
    steps : int
        Number of steps, the first one counts 1.
    most : int
        Number of unknown cells after which a ray ends; at least 1.
    """
    total = 0
    for ray in range(RAYS):
        unknown = 0
        for step in range(steps):
            level = int(vector_at(cell + int(grid_at(offsets, steps, RAYS, np.int32)[step, ray]), 1, np.int8)[0])
            if level > 0:
                break
            if level == 0:
                total += step + 1
                unknown += 1
                if unknown >= most:
                    break
    return total


@llvm_overload(unknown_in_view, types.int64, *(types.int64,) * 4)
def _(builder: Builder, cell: Value, offsets: Value, steps: Value, most: Value) -> Value:
    zeros, ones, level_zero = constant(_INTS, 0), constant(_INTS, 1), constant(_BYTES, 0)
    last, groups = splat(builder, most, _INTS), range(RAYS // _GROUP)
    alive, unknown, seen = (
        [stack_slot(builder, value) for _ in groups] for value in (constant(_FLAGS, 1), zeros, zeros)
    )
    with for_range(builder, steps) as loop:
        row = builder.add(offsets, builder.mul(loop.index, ir.Constant(loop.index.type, 4 * RAYS)))
        count = splat(builder, builder.add(loop.index, ir.Constant(loop.index.type, 1)), _INTS)
        for group in groups:
            with builder.if_then(any_of(builder, builder.load(alive[group]))):
                levels = level_zero
                for lane in range(_GROUP):
                    offset = load_at(builder, row, INT, 4 * (_GROUP * group + lane))
                    level = load_at(builder, builder.add(cell, builder.sext(offset, cell.type)), ir.IntType(8))
                    levels = builder.insert_element(levels, level, ir.Constant(INT, lane))
                is_alive = builder.load(alive[group])
                is_unknown = builder.and_(is_alive, builder.icmp_signed("==", levels, level_zero))
                summed = builder.add(builder.load(seen[group]), builder.select(is_unknown, count, zeros))
                number = builder.add(builder.load(unknown[group]), builder.select(is_unknown, ones, zeros))
                is_free = builder.icmp_signed("<=", levels, level_zero)
                goes_on = builder.and_(is_free, builder.icmp_signed("<", number, last))
                for slot, value in ((seen, summed), (unknown, number), (alive, builder.and_(is_alive, goes_on))):
                    builder.store(value, slot[group])
        some = builder.or_(*(builder.load(slot) for slot in alive))
        with builder.if_then(builder.not_(any_of(builder, some))):
            loop.do_break()
    total = builder.add(*(builder.load(slot) for slot in seen))
    return builder.zext(call(builder, f"llvm.vector.reduce.add.v{_GROUP}i32", INT, total), cell.type)
