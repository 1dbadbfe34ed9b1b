"""Costs of 16 cells of a row, lowered by those of the row above or below it and by those of its own.

Grids lie next to each other with the same shape, and one index finds a cell in all of them. A border around
them ensures that a block of cells always has neighbours.
"""

import numpy as np
from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.llvm import (
    INT,
    Builder,
    Value,
    any_of,
    bits_of_lanes,
    constant,
    gather,
    if_any,
    llvm_overload,
    load_at,
    min_lanes,
    splat,
    store_at,
    vector,
)
from lidarium.mapping.kernels.simd.words import bits_of
from lidarium.mapping.kernels.views import grid_at, vector_at

LANES = 16
"""Cells of a block."""

FAR = 2**29
"""Cost of what cannot be reached, and more than any other [units]."""

FREE, FITS, ROOMY = 1, 2, 4
"""Bits of a cell's kind: it is free, the body fits there, the cells around it are clear as well."""

_BYTES, _SHORTS = vector(ir.IntType(8), LANES), vector(ir.IntType(16), LANES)
_INTS = vector(INT, LANES)
_NOWHERE, _ZEROS = constant(_INTS, FAR), constant(_INTS, 0)


# -- Steps -------------------------------------------------------------------------------------------------


def relax_forwards(costs: int, straight: int, diagonal: int, kinds: int, at: int, beside: int) -> int:
    """Lower the costs of the 16 cells at an index, in the order of columns; return which have changed.

    They are lowered by the costs of the row above or below, and by those of the cells before them.
    """
    return _relax((costs, straight, diagonal, kinds), at, beside, 1)


def relax_backwards(costs: int, straight: int, diagonal: int, kinds: int, at: int, beside: int) -> int:
    """Do as ``relax_forwards`` against the order of columns."""
    return _relax((costs, straight, diagonal, kinds), at, beside, -1)


def _relax(grids: tuple[int, int, int, int], at: int, beside: int, step: int) -> int:
    size = max(at, beside) + LANES + 1
    costs, straight, diagonal = (vector_at(grid, size, np.int32) for grid in grids[:3])
    kinds, changed = vector_at(grids[3], size, np.uint8), 0
    for k in range(LANES)[::step]:
        cell, before = at + k, costs[at + k]
        if not kinds[cell] & FITS:
            continue
        ways = [before, FAR, costs[beside + k] + straight[beside + k] + straight[cell]]
        ways.append(costs[cell - step] + straight[cell - step] + straight[cell])
        for side in (-1, 1):
            corner, between = beside + k + side, (kinds[beside + k], kinds[cell + side])
            is_roomy = kinds[cell] & kinds[corner] & ROOMY and (between[0] | between[1]) & FREE
            if is_roomy or between[0] & between[1] & FITS:
                ways.append(costs[corner] + diagonal[corner] + diagonal[cell])
        costs[cell] = min(ways)
        changed |= int(costs[cell] != before) << k
    return changed


def _relax_lanes(builder: Builder, grids: tuple[Value, ...], at: Value, beside: Value, step: int) -> Value:
    costs, straight, diagonal, kinds = grids
    before = _cells(builder, costs, at, 0)
    own, own_diagonal = (_cells(builder, grid, at, 0) for grid in (straight, diagonal))
    reached = [_cells(builder, grid, beside, 0) for grid in (costs, straight)]
    new = min_lanes(builder, before, builder.add(builder.add(*reached), own))
    for side in (-1, 1):
        reached = [_cells(builder, grid, beside, side) for grid in (costs, diagonal)]
        through = builder.add(builder.add(*reached), own_diagonal)
        is_open = _diagonal_is_open(builder, kinds, at, beside, side)
        new = min_lanes(builder, new, builder.select(is_open, through, _NOWHERE))
    fits = _has_bits(builder, _cells(builder, kinds, at, 0, _BYTES), FITS)
    new = builder.select(fits, new, before)
    step_costs = builder.add(own, _cells(builder, straight, at, -step))
    new = _relax_along(builder, new, builder.select(fits, step_costs, _NOWHERE), costs, at, step)
    new = min_lanes(builder, new, _NOWHERE)
    changed = builder.icmp_signed("!=", new, before)
    with if_any(builder, changed):
        store_at(builder, new, builder.add(costs, builder.mul(at, ir.Constant(at.type, 4))))
    return builder.zext(bits_of_lanes(builder, changed), at.type)


def _cells(builder: Builder, grid: Value, index: Value, offset: int, cell_type: Value = _INTS) -> Value:
    """Load a block of a grid, or one number, a number of cells after an index."""
    element = cell_type.element if isinstance(cell_type, ir.VectorType) else cell_type
    size = element.width // 8
    at = builder.add(grid, builder.mul(index, ir.Constant(index.type, size)))
    return load_at(builder, at, cell_type, size * offset)


def _has_bits(builder: Builder, bits: Value, mask: int) -> Value:
    return builder.icmp_unsigned("!=", builder.and_(bits, constant(_BYTES, mask)), constant(_BYTES, 0))


def _diagonal_is_open(builder: Builder, kinds: Value, at: Value, beside: Value, side: int) -> Value:
    """Whether a step leads to each cell from that of the other row and ``side`` columns on.

    The body fits in both cells between, or both ends are roomy and one of the cells between is free.
    """
    own, corner = (_cells(builder, kinds, *index, _BYTES) for index in ((at, 0), (beside, side)))
    across, along = (_cells(builder, kinds, *index, _BYTES) for index in ((beside, 0), (at, side)))
    both_fit = builder.and_(builder.and_(across, along), constant(_BYTES, FITS))
    one_is_free = builder.shl(builder.or_(across, along), constant(_BYTES, 2))
    ends_are_roomy = builder.and_(builder.and_(own, corner), constant(_BYTES, ROOMY))
    return _has_bits(builder, builder.or_(both_fit, builder.and_(ends_are_roomy, one_is_free)), 0xFF)


def _relax_along(builder: Builder, new: Value, step_costs: Value, costs: Value, at: Value, step: int) -> Value:
    """Lower costs by those of the cells before them in the row.

    ``step_costs`` are those of the steps that lead to each cell; n rounds take all cells of up to 2 ** n steps
    before into account.
    """
    first = ir.Constant(INT, 0 if step > 0 else LANES - 1)
    carried = _cells(builder, costs, at, -1 if step > 0 else LANES, INT)
    entered = builder.add(carried, builder.extract_element(step_costs, first))
    lowest = min_lanes(builder, builder.extract_element(new, first), entered)
    new, count = builder.insert_element(new, lowest, first), 1
    while count < LANES:
        new = min_lanes(builder, new, builder.add(_shifted(builder, new, count, step), step_costs))
        twice = builder.add(step_costs, _shifted(builder, step_costs, count, step))
        step_costs, count = min_lanes(builder, twice, _NOWHERE), 2 * count
    return new


def _shifted(builder: Builder, lanes: Value, count: int, step: int) -> Value:
    """Move the lanes on in the direction of the step; far lanes move in."""
    sources = [k - count * step for k in range(LANES)]
    chosen = [source if 0 <= source < LANES else LANES for source in sources]
    return builder.shuffle_vector(lanes, _NOWHERE, constant(_INTS, *chosen))


@llvm_overload(relax_forwards, types.int64, *(types.int64,) * 6)
def _(builder: Builder, *values: Value) -> Value:
    return _relax_lanes(builder, values[:4], values[4], values[5], 1)


@llvm_overload(relax_backwards, types.int64, *(types.int64,) * 6)
def _(builder: Builder, *values: Value) -> Value:
    return _relax_lanes(builder, values[:4], values[4], values[5], -1)


def cheaper_cells(costs: int, limit: int) -> int:
    """Return which of 16 int32 costs at an address are below a limit, bit 0 the first one."""
    return int(bits_of(vector_at(costs, LANES, np.int32) < limit))


@llvm_overload(cheaper_cells, types.int64, types.int64, types.int64)
def _(builder: Builder, costs: Value, limit: Value) -> Value:
    below = builder.icmp_signed("<", load_at(builder, costs, _INTS), splat(builder, limit, _INTS))
    return builder.zext(bits_of_lanes(builder, below), limit.type)


# -- Costs of cells ----------------------------------------------------------------------------------------


def look_up_costs(log_odds: int, closeness: int, body: int, kinds: int, straight: int, diagonal: int) -> None:
    """Write the kinds of 16 cells, and half the costs of steps into and out of them."""
    table, length, same_up_to, tight, roomy = vector_at(body, 5, np.int64).tolist()
    near = np.array(vector_at(closeness, LANES, np.uint16))
    free = np.array(vector_at(log_odds, LANES, np.int8) < 0)
    fits = free & (near <= tight)
    vector_at(kinds, LANES, np.uint8)[:] = FREE * free + FITS * fits + ROOMY * (free & (near <= roomy))
    if not fits.any():
        return
    indices = np.where(near > same_up_to, near, 0)
    for result, costs in zip((straight, diagonal), grid_at(table, 2, length, np.int32), strict=True):
        vector_at(result, LANES, np.int32)[:] = np.where(fits, np.array(costs)[indices], 0)


@llvm_overload(look_up_costs, types.void, *(types.int64,) * 6)
def _(
    builder: Builder,
    log_odds: Value,
    closeness: Value,
    body: Value,
    kinds: Value,
    straight: Value,
    diagonal: Value,
) -> Value:
    table, length, same, tight, roomy = (load_at(builder, body, body.type, 8 * k) for k in range(5))
    near = builder.zext(load_at(builder, closeness, _SHORTS), _INTS)
    free = builder.icmp_signed("<", load_at(builder, log_odds, _BYTES), constant(_BYTES, 0))
    is_tight, is_roomy, is_same = (
        builder.icmp_signed("<=", near, splat(builder, limit, _INTS)) for limit in (tight, roomy, same)
    )
    fits = builder.and_(free, is_tight)
    free_bit, fits_bit, roomy_bit = (
        builder.select(has_bit, constant(_BYTES, bit), constant(_BYTES, 0))
        for has_bit, bit in ((free, FREE), (fits, FITS), (builder.and_(free, is_roomy), ROOMY))
    )
    store_at(builder, builder.or_(builder.or_(free_bit, fits_bit), roomy_bit), kinds)
    is_dear = any_of(builder, builder.and_(fits, builder.not_(is_same)))
    with if_any(builder, fits):
        offsets = builder.mul(near, constant(_INTS, 4))
        for k, result in enumerate((straight, diagonal)):
            row = builder.add(table, builder.mul(length, ir.Constant(length.type, 4 * k)))
            with builder.if_else(is_dear) as (dear, cheap):
                with dear:
                    store_at(builder, gather(builder, row, offsets, fits), result)
                with cheap:
                    first = splat(builder, load_at(builder, row, INT), _INTS)
                    store_at(builder, builder.select(fits, first, _ZEROS), result)
