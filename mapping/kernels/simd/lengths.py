"""Lengths of paths from many places at once over the cells of a run: a lane for each place.

A run is a row of cells next to each other. Each cell has a length from every place, and cells are found by their
numbers; number 0 is a cell that no path reaches.
"""

from collections.abc import Callable

import numpy as np
from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.llvm import (
    Builder,
    Value,
    any_of,
    constant,
    for_range,
    lanewise,
    llvm_overload,
    load_at,
    splat,
    stack_slot,
    store_at,
    vector,
)
from lidarium.mapping.kernels.views import grid_at, vector_at

LANES, FEW_LANES = 32, 8
"""Places at once: of views, and of robots."""

STRAIGHT, DIAGONAL = 5, 7
"""Lengths of the steps to the neighbours of a cell, in fifths of its side."""

FAR = 65535
"""Length of a path that there is none of; longer ones count as none."""

_BYTES = 2


def lower_run(lanes: int, beside: int, first: int, count: int) -> int:
    """Lower the lengths of a run by those of the cells of a row beside it and of its own; return if any changed.

    Parameters
    ----------
    lanes : int
        Address of the lengths, (cells, LANES) uint16.
    beside : int
        Address of the numbers, (count + 2,) int32, of the cells beside it, from one column before it on.
    first, count : int
        Number of its first cell; those of the others follow.
    """
    return _lower(LANES, lanes, beside, first, count)


def lower_run_of_few(lanes: int, beside: int, first: int, count: int) -> int:
    """Do as ``lower_run`` with FEW_LANES."""
    return _lower(FEW_LANES, lanes, beside, first, count)


def _lower(width: int, lanes: int, beside: int, first: int, count: int) -> int:
    numbers = vector_at(beside, count + 2, np.int32)
    table = grid_at(lanes, max(int(numbers.max()), first + count - 1) + 1, width, np.uint16)
    before = table[first : first + count].copy()
    for k in [*range(count), *range(count)[::-1]]:
        steps = [(int(numbers[k]), DIAGONAL), (int(numbers[k + 1]), STRAIGHT), (int(numbers[k + 2]), DIAGONAL)]
        steps += [(first + other, STRAIGHT) for other in (k - 1, k + 1) if 0 <= other < count]
        ways = [np.array(table[number]).astype(np.int64) + length for number, length in steps]
        table[first + k] = np.min([np.array(table[first + k]), *ways], axis=0)
    return int((np.array(table[first : first + count]) != np.array(before)).any())


def _overload(width: int) -> Callable[..., Value]:
    kind = vector(ir.IntType(16), width)
    straight, diagonal, far = (constant(kind, number) for number in (STRAIGHT, DIAGONAL, FAR))

    def lower(builder: Builder, lanes: Value, beside: Value, first: Value, count: Value) -> Value:
        def at(number: Value) -> Value:
            return builder.add(lanes, builder.mul(number, ir.Constant(number.type, width * _BYTES)))

        def lengths_beside(index: Value, offset: int) -> Value:
            place = builder.add(beside, builder.mul(index, ir.Constant(index.type, 4)))
            number = load_at(builder, place, ir.IntType(32), 4 * offset)
            return load_at(builder, at(builder.zext(number, lanes.type)), kind)

        def shortest(first: Value, *others: Value) -> Value:
            for other in others:
                first = lanewise(builder, "umin", first, other)
            return first

        def after(length: Value, step: Value) -> Value:
            return lanewise(builder, "uadd.sat", length, step)

        zero = ir.Constant(lanes.type, 0)
        behind, corner, across = (
            stack_slot(builder, value) for value in (far, lengths_beside(zero, 0), lengths_beside(zero, 1))
        )
        changed = stack_slot(builder, constant(kind, 0))
        for is_first in (True, False):
            with for_range(builder, count) as loop:
                index = (
                    loop.index if is_first else builder.sub(builder.sub(count, loop.index), ir.Constant(count.type, 1))
                )
                place = at(builder.add(first, index))
                before, ways = load_at(builder, place, kind), [builder.load(behind)]
                if is_first:
                    ahead, middle = lengths_beside(index, 2), builder.load(across)
                    diagonals = after(shortest(builder.load(corner), ahead), diagonal)
                    ways.append(middle)
                    builder.store(middle, corner)
                    builder.store(ahead, across)
                new = shortest(before, after(shortest(*ways), straight))
                if is_first:
                    new = shortest(new, diagonals)
                store_at(builder, new, place)
                builder.store(new, behind)
                builder.store(builder.or_(builder.load(changed), builder.xor(new, before)), changed)
            builder.store(far, behind)
        some = builder.icmp_unsigned("!=", builder.load(changed), constant(kind, 0))
        return builder.zext(any_of(builder, some), lanes.type)

    return lower


for _function, _width in ((lower_run, LANES), (lower_run_of_few, FEW_LANES)):
    llvm_overload(_function, types.int64, *(types.int64,) * 4)(_overload(_width))


def begin_with_bounds(lanes: int, known: int, to_hubs: int, hubs: int, cells: int) -> None:
    """Write the lengths of the shortest paths past one of some hubs, ``FAR`` to cell 0.

    Parameters
    ----------
    lanes : int
        Address of the lengths from places, (cells, LANES) uint16; written.
    known : int
        Address of the lengths from hubs, (cells, FEW_LANES) uint16.
    to_hubs : int
        Address of the lengths from each place to each hub, (hubs, LANES) uint16.
    """
    beyond = np.array(grid_at(known, cells, FEW_LANES, np.uint16)).astype(np.int64)
    ways = np.array(grid_at(to_hubs, hubs, LANES, np.uint16)).astype(np.int64)
    found = (beyond[:, :hubs, None] + ways[None]).min(axis=1, initial=FAR)
    found[0] = FAR
    grid_at(lanes, cells, LANES, np.uint16)[:] = found


@llvm_overload(begin_with_bounds, types.void, *(types.int64,) * 5)
def _(builder: Builder, lanes: Value, known: Value, to_hubs: Value, hubs: Value, cells: Value) -> None:
    length, kind = ir.IntType(16), vector(ir.IntType(16), LANES)
    best = stack_slot(builder, constant(kind, FAR))
    with for_range(builder, cells) as cell_loop:
        builder.store(constant(kind, FAR), best)
        row = builder.mul(cell_loop.index, ir.Constant(cells.type, FEW_LANES * _BYTES))
        with for_range(builder, hubs) as loop:
            place = builder.add(builder.add(known, row), builder.mul(loop.index, ir.Constant(hubs.type, _BYTES)))
            beyond = splat(builder, load_at(builder, place, length), kind)
            hub = builder.add(to_hubs, builder.mul(loop.index, ir.Constant(hubs.type, LANES * _BYTES)))
            way = lanewise(builder, "uadd.sat", load_at(builder, hub, kind), beyond)
            builder.store(lanewise(builder, "umin", builder.load(best), way), best)
        place = builder.mul(cell_loop.index, ir.Constant(cells.type, LANES * _BYTES))
        store_at(builder, builder.load(best), builder.add(lanes, place))
    store_at(builder, constant(kind, FAR), lanes)
