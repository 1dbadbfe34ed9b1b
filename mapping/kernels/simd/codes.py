"""The nearest code of the 64 points of a tile, all in registers."""

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from lidarium.mapping.kernels.llvm import (
    INT,
    Builder,
    Value,
    llvm_overload,
    load_at,
    splat,
    stack_slot,
    store_at,
    vector,
)
from lidarium.mapping.kernels.views import grid_at, vector_at

TILE = 64
"""Points of a tile."""

_LANES = 16
_INTS, _REALS = vector(INT, _LANES), vector(ir.FloatType(), _LANES)
_SIZE, _VECTOR_SIZE = 4, 4 * _LANES


def nearest_in_tile(points: int, codes: int, numbers: int, count: int, squares: int, labels: int) -> None:
    """Lower squared distances of a tile's points to those of codes, and note the nearest.

    All but ``count`` are addresses: of the (3, 64) float32 coordinates, (count, 3) float32 codes, (count,) int32
    numbers of the codes, (64,) float32 squared distances so far, and (64,) int32 labels so far. Of equal codes the
    first stays.
    """
    nearest, chosen = vector_at(squares, TILE, np.float32), vector_at(labels, TILE, np.int32)
    coordinates = np.array(grid_at(points, 3, TILE, np.float32))
    for k in range(count):
        code, number = (
            np.array(vector_at(codes + 12 * k, 3, np.float32)),
            vector_at(numbers, count, np.int32)[k],
        )
        x, y, z = (coordinates - code[:, None]) ** 2
        square = x + y + z
        is_nearer = square < nearest
        nearest[:], chosen[:] = np.where(is_nearer, square, nearest), np.where(is_nearer, number, chosen)


@llvm_overload(nearest_in_tile, types.void, *(types.int64,) * 6)
def _(
    builder: Builder, points: Value, codes: Value, numbers: Value, count: Value, squares: Value, labels: Value
) -> Value:
    offsets = range(0, TILE * _SIZE, _VECTOR_SIZE)
    sides = [
        [load_at(builder, points, _REALS, axis * TILE * _SIZE + offset) for axis in range(3)] for offset in offsets
    ]
    nearest = [stack_slot(builder, load_at(builder, squares, _REALS, offset)) for offset in offsets]
    chosen = [stack_slot(builder, load_at(builder, labels, _INTS, offset)) for offset in offsets]
    with cgutils.for_range(builder, count) as step:
        at = builder.add(codes, builder.mul(step.index, ir.Constant(codes.type, 3 * _SIZE)))
        code = [splat(builder, load_at(builder, at, _REALS.element, axis * _SIZE), _REALS) for axis in range(3)]
        at = builder.add(numbers, builder.mul(step.index, ir.Constant(numbers.type, _SIZE)))
        number = splat(builder, load_at(builder, at, INT), _INTS)
        for side, least, label in zip(sides, nearest, chosen, strict=True):
            across = [builder.fsub(own, other) for own, other in zip(side, code, strict=True)]
            x, y, z = (builder.fmul(each, each) for each in across)
            square, old = builder.fadd(builder.fadd(x, y), z), builder.load(least)
            is_nearer = builder.fcmp_ordered("<", square, old)
            builder.store(builder.select(is_nearer, square, old), least)
            builder.store(builder.select(is_nearer, number, builder.load(label)), label)
    for slots, target in ((nearest, squares), (chosen, labels)):
        for slot, offset in zip(slots, offsets, strict=True):
            store_at(builder, builder.load(slot), target, offset)
