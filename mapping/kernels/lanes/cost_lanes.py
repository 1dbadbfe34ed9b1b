"""Costs of the cells of a row, lowered by those of the row beside it and of its own, 16 cells at once.

Grids lie side by side with the same shape, and a cell is known by its place in all of them. There is a border
around them, so that a block of cells always has neighbours.
"""

from typing import Any

from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.in_python import plain_forms
from lidarium.mapping.kernels.in_python.interpreted import machine_code
from lidarium.mapping.kernels.lanes.ray_groups import GROUP, INT, INTS, ZEROS, gather, smaller, spread

LANES = GROUP
"""Cells of a block."""

FAR = 2**29
"""Cost of what cannot be reached, and more than any other [units]."""

FREE, FITS, ROOMY = 1, 2, 4
"""Bits of the kind of a cell: it is free, the body fits there, it has room beside it."""

_BYTES, _SHORTS = ir.VectorType(ir.IntType(8), LANES), ir.VectorType(ir.IntType(16), LANES)
_NOWHERE = ir.Constant(INTS, [FAR] * LANES)


def _load(builder: Any, grid: Any, place: Any, beside: int, kind: Any) -> Any:  # noqa: ANN401
    """Load a block of a grid, or a single number, from so many cells beside a place."""
    number = kind.element if isinstance(kind, ir.VectorType) else kind
    size = ir.Constant(place.type, number.width // 8)
    cell = builder.add(place, ir.Constant(place.type, beside))
    pointer = builder.inttoptr(builder.add(grid, builder.mul(cell, size)), kind.as_pointer())
    return builder.load(pointer, align=number.width // 8)


def _shifted(builder: Any, lanes: Any, count: int, step: int) -> Any:  # noqa: ANN401
    """Move the lanes on in the direction of the step; what moves in is far."""
    places = [k - count * step for k in range(LANES)]
    chosen = [place if 0 <= place < LANES else LANES for place in places]
    return builder.shuffle_vector(lanes, _NOWHERE, ir.Constant(INTS, chosen))


def _has_bits(builder: Any, bits: Any, mask: int) -> Any:  # noqa: ANN401
    found = builder.and_(bits, ir.Constant(_BYTES, [mask] * LANES))
    return builder.icmp_unsigned("!=", found, ir.Constant(_BYTES, [0] * LANES))


def _any(builder: Any, lanes: Any) -> Any:  # noqa: ANN401
    bits = builder.bitcast(lanes, ir.IntType(LANES))
    return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))


def _diagonal_is_open(builder: Any, kinds: Any, at: Any, beside: Any, side: int) -> Any:  # noqa: ANN401
    """Whether a step leads to each cell from that of the row beside and so many columns on.

    The body fits in both cells between, or both ends have room and one of the cells between is free.
    """
    own, corner = (_load(builder, kinds, *place, _BYTES) for place in ((at, 0), (beside, side)))
    across, along = (_load(builder, kinds, *place, _BYTES) for place in ((beside, 0), (at, side)))
    both_fit = builder.and_(builder.and_(across, along), ir.Constant(_BYTES, [FITS] * LANES))
    one_is_free = builder.shl(builder.or_(across, along), ir.Constant(_BYTES, [2] * LANES))
    ends_are_roomy = builder.and_(builder.and_(own, corner), ir.Constant(_BYTES, [ROOMY] * LANES))
    return _has_bits(builder, builder.or_(both_fit, builder.and_(ends_are_roomy, one_is_free)), 0xFF)


def _relaxed(step: int) -> Any:  # noqa: ANN401
    """Return what generates the code for one direction along the rows."""

    def relax(
        typing_context: Any,  # noqa: ANN401
        costs: Any,  # noqa: ANN401
        straight: Any,  # noqa: ANN401
        diagonal: Any,  # noqa: ANN401
        kinds: Any,  # noqa: ANN401
        at: Any,  # noqa: ANN401
        beside: Any,  # noqa: ANN401
    ) -> Any:  # noqa: ANN401
        """Lower the costs of a block; return which have changed, bit 0 the first."""
        return types.int64(*(types.int64,) * 6), generate

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        costs, straight, diagonal, kinds, at, beside = arguments
        before = _load(builder, costs, at, 0, INTS)
        own, own_diagonal = (_load(builder, grid, at, 0, INTS) for grid in (straight, diagonal))
        reached = [_load(builder, grid, beside, 0, INTS) for grid in (costs, straight)]
        new = smaller(builder, before, builder.add(builder.add(*reached), own))
        for side in (-1, 1):
            reached = [_load(builder, grid, beside, side, INTS) for grid in (costs, diagonal)]
            through = builder.add(builder.add(*reached), own_diagonal)
            is_open = _diagonal_is_open(builder, kinds, at, beside, side)
            new = smaller(builder, new, builder.select(is_open, through, _NOWHERE))
        fits = _has_bits(builder, _load(builder, kinds, at, 0, _BYTES), FITS)
        new = builder.select(fits, new, before)
        step_costs = builder.add(own, _load(builder, straight, at, -step, INTS))
        new = _along(builder, new, builder.select(fits, step_costs, _NOWHERE), costs, at, step)
        new = smaller(builder, new, _NOWHERE)
        changed = builder.bitcast(builder.icmp_signed("!=", new, before), ir.IntType(LANES))
        with builder.if_then(builder.icmp_unsigned("!=", changed, ir.Constant(changed.type, 0))):
            place = builder.add(costs, builder.mul(at, ir.Constant(at.type, 4)))
            builder.store(new, builder.inttoptr(place, INTS.as_pointer()), align=4)
        return builder.zext(changed, at.type)

    return relax


def _along(builder: Any, new: Any, step_costs: Any, costs: Any, at: Any, step: int) -> Any:  # noqa: ANN401
    """Lower costs by those of the cells before them in the row.

    ``step_costs`` are those of the steps that lead to each cell; after n rounds all cells of up to 2 ** n
    steps before have been taken into account.
    """
    first = ir.Constant(INT, 0 if step > 0 else LANES - 1)
    carried = _load(builder, costs, at, -1 if step > 0 else LANES, INT)
    entered = builder.add(carried, builder.extract_element(step_costs, first))
    lowest = smaller(builder, builder.extract_element(new, first), entered)
    new, count = builder.insert_element(new, lowest, first), 1
    while count < LANES:
        new = smaller(builder, new, builder.add(_shifted(builder, new, count, step), step_costs))
        twice = builder.add(step_costs, _shifted(builder, step_costs, count, step))
        step_costs, count = smaller(builder, twice, _NOWHERE), 2 * count
    return new


def _cheaper_cells(typing_context: Any, costs: Any, limit: Any) -> Any:  # noqa: ANN401
    """Return which of 16 costs at an address are below a limit, bit 0 the first."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        costs, limit = arguments
        lanes = builder.load(builder.inttoptr(costs, INTS.as_pointer()), align=4)
        limits = spread(builder, builder.trunc(limit, INT), INTS)
        below = builder.bitcast(builder.icmp_signed("<", lanes, limits), ir.IntType(LANES))
        return builder.zext(below, limit.type)

    return types.int64(types.int64, types.int64), generate


def _write_costs(builder: Any, costs: Any, near: Any, lanes: Any, results: Any) -> None:  # noqa: ANN401
    """Write what straight and diagonal steps cost in the lanes that fit."""
    (table, length), (fits, is_dear) = costs, lanes
    offsets, zero = builder.mul(near, ir.Constant(INTS, [4] * LANES)), ir.Constant(length.type, 0)
    for k, result in enumerate(results):
        row = builder.add(table, builder.mul(length, ir.Constant(length.type, 4 * k)))
        place = builder.inttoptr(result, INTS.as_pointer())
        with builder.if_else(is_dear) as (dear, cheap):
            with dear:
                builder.store(gather(builder, row, offsets, fits), place, align=4)
            with cheap:
                same = spread(builder, _load(builder, row, zero, 0, INT), INTS)
                builder.store(builder.select(fits, same, ZEROS), place, align=4)


def _look_up(
    typing_context: Any,  # noqa: ANN401
    log_odds: Any,  # noqa: ANN401
    closeness: Any,  # noqa: ANN401
    body: Any,  # noqa: ANN401
    kinds: Any,  # noqa: ANN401
    straight: Any,  # noqa: ANN401
    diagonal: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Write the kinds of 16 cells and what steps cost there."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        log_odds, closeness, body, kinds, *results = arguments
        zero = ir.Constant(body.type, 0)
        table, length, plain, tight, roomy = (_load(builder, body, zero, k, body.type) for k in range(5))
        beliefs = _load(builder, log_odds, zero, 0, _BYTES)
        near = builder.zext(_load(builder, closeness, zero, 0, _SHORTS), INTS)
        free = builder.icmp_signed("<", beliefs, ir.Constant(_BYTES, [0] * LANES))
        near_up_to = [
            builder.icmp_signed("<=", near, spread(builder, builder.trunc(limit, INT), INTS))
            for limit in (tight, roomy, plain)
        ]
        fits, has_room = (builder.and_(free, is_near) for is_near in near_up_to[:2])
        kinds_of = [
            builder.select(has_bit, ir.Constant(_BYTES, [bit] * LANES), ir.Constant(_BYTES, [0] * LANES))
            for has_bit, bit in ((free, FREE), (fits, FITS), (has_room, ROOMY))
        ]
        place = builder.inttoptr(kinds, _BYTES.as_pointer())
        builder.store(builder.or_(builder.or_(kinds_of[0], kinds_of[1]), kinds_of[2]), place, align=1)
        is_dear = _any(builder, builder.and_(fits, builder.not_(near_up_to[2])))
        with builder.if_then(_any(builder, fits)):
            _write_costs(builder, (table, length), near, (fits, is_dear), results)

    return types.void(*(types.int64,) * 6), generate


look_up_costs = machine_code(_look_up, plain_forms.look_up_costs)
"""Write the kinds of 16 cells, and half the costs of steps into and out of them.

Parameters
----------
log_odds, closeness : int
    Addresses of the cells' log-odds, int8, and closeness, uint16.
body : int
    Address of five int64 numbers: the address of the int32 costs by closeness, first of straight and then of
    diagonal steps; how many there are of each; the closeness up to which all cost the same, up to which the
    body fits, and up to which a cell is roomy.
kinds, straight, diagonal : int
    Where the uint8 kinds and the int32 costs are written: 0 where the body does not fit, nothing where it
    fits in none of the cells.
"""

cheaper_cells = machine_code(_cheaper_cells, plain_forms.cheaper_cells)
"""Return which of 16 int32 costs at an address are below a limit, bit 0 the first one."""

relax_forwards = machine_code(_relaxed(1), plain_forms.relax_forwards)
"""Lower the costs of the 16 cells at a place of a row, going along it in the order of columns.

They are lowered by the costs of the row beside it, and by those of the cells before them.

Parameters
----------
costs, straight, diagonal, kinds : int
    Addresses of the grids: int32 costs, and int32 half costs of steps into and out of a cell, 0 where the
    body does not fit; uint8 kinds.
at, beside : int
    Places of the first cell of the block, and of that above or below it.

Returns
-------
int
    Bits of the cells whose costs have changed, bit 0 the first one.
"""

relax_backwards = machine_code(_relaxed(-1), plain_forms.relax_backwards)
"""Do as ``relax_forwards``, against the order of columns."""
