"""Rays, and bundles of rays, that travel through the empty squares of a floor 32 at once.

They are two groups of sixteen: while one waits for what it looks up, the other goes on. Each lane does the
arithmetic of the plain definition in its order, so that both give the same to the bit.
"""

from collections.abc import Sequence
from typing import Any

from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.in_python import plain_forms
from lidarium.mapping.kernels.in_python.interpreted import machine_code
from lidarium.mapping.kernels.lanes.ray_groups import (
    FLAGS,
    FLOAT,
    GROUP,
    GROUPS,
    NO_REALS,
    REALS,
    ZEROS,
    Advance,
    Axis,
    Rows,
    Squares,
    cells_at,
    larger,
    smaller,
    spread,
    travel_groups,
)

_numba_types: Any = types


def _advance_rays(builder: Any, squares: Squares, across: Axis, up: Axis, reach: Any) -> Advance:  # noqa: ANN401
    """Return how rays (distance, column, row) move through one square."""

    def advance(state: Any, alive: Any) -> Any:  # noqa: ANN401
        distance, column, row = state
        side = squares.sides(column, row, alive)
        is_free = builder.icmp_signed("!=", side, ZEROS)
        border_x, border_y = across.border(column, side), up.border(row, side)
        distance_x, distance_y = across.distance(border_x), up.distance(border_y)
        is_x = builder.fcmp_ordered("<=", distance_x, distance_y)
        # Each of the two is one instruction: what follows waits for them, and not for a comparison.
        is_less = builder.fcmp_ordered("<", distance_x, distance_y)
        nearest = builder.select(is_less, distance_x, distance_y)
        further = builder.select(builder.fcmp_ordered(">", nearest, distance), nearest, distance)
        start, direction = (
            builder.select(is_x, getattr(up, name), getattr(across, name)) for name in ("start", "direction")
        )
        crossed = cells_at(builder, start, direction, further)
        own = builder.select(is_x, row, column)
        last = builder.select(is_x, up.before(border_y), across.before(border_x))
        low, high = smaller(builder, own, last), larger(builder, own, last)
        inside = smaller(builder, larger(builder, crossed, low), high)
        column = builder.select(is_x, across.behind(border_x), inside)
        row = builder.select(is_x, inside, up.behind(border_y))
        distance = builder.select(is_free, further, distance)
        is_on = builder.and_(is_free, builder.fcmp_ordered("<", distance, reach))
        return (distance, column, row), builder.and_(alive, is_on)

    return advance


def _travel_rays(
    typing_context: Any,  # noqa: ANN401
    squares: Any,  # noqa: ANN401
    shape: Any,  # noqa: ANN401
    origin: Any,  # noqa: ANN401
    together: Any,  # noqa: ANN401
    directions: Any,  # noqa: ANN401
    stride: Any,  # noqa: ANN401
    ranges: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Write where rays that are free up to a distance enter a solid cell, or the reach.

    Addresses are: of the squares (4, rows, columns) uint8, with ``BEHIND`` bytes to read behind them; of the
    distances of the groups (2,); of 32 beams in the directions' four rows, so many bytes apart; of the
    ranges (32,). The shape is cells of a plane and columns; the origin is x, y and the reach [cells].
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        squares, shape, origin, together, directions, stride, ranges = arguments
        x, y, reach = (builder.extract_value(origin, place) for place in range(3))
        reach = spread(builder, reach, REALS)
        starts, alive, advances, pointers = [], [], [], []
        for group in range(GROUPS):
            rows = Rows(builder, directions, stride, group)
            across = Axis(builder, x, rows.load(0), rows.load(2))
            up = Axis(builder, y, rows.load(1), rows.load(3))
            pointers.append(Rows(builder, ranges, stride, group).pointer(0))
            offset = ir.Constant(together.type, group * FLOAT)
            lone = builder.inttoptr(builder.add(together, offset), REALS.element.as_pointer())
            start = spread(builder, builder.load(lone), REALS)
            starts.append((start, across.cells(start), up.cells(start)))
            alive.append(builder.fcmp_ordered("<", start, reach))
            table = Squares(builder, squares, shape, across, up)
            advances.append(_advance_rays(builder, table, across, up, reach))
        for end, pointer in zip(travel_groups(builder, starts, alive, advances), pointers, strict=True):
            is_short = builder.fcmp_ordered("<", reach, end)
            builder.store(builder.select(is_short, reach, end), pointer, align=FLOAT)

    numbers = _numba_types.UniTuple(types.int64, 2), _numba_types.UniTuple(types.float64, 3)
    return types.void(types.int64, *numbers, *(types.int64,) * 4), generate


def _advance_bundles(
    builder: Any,  # noqa: ANN401
    squares: Squares,
    outer: Sequence[tuple[Axis, Any]],
    reach: Any,  # noqa: ANN401
    inside: Any,  # noqa: ANN401
) -> Advance:
    """Return how bundles (distance,) move through one square, by their axes and last rays."""

    def advance(state: Any, alive: Any) -> Any:  # noqa: ANN401
        (distance,) = state
        nearest, spans = [], []
        for axis, last in outer:
            first_cell, last_cell = axis.cells(distance), cells_at(builder, axis.start, last, distance)
            low, high = smaller(builder, first_cell, last_cell), larger(builder, first_cell, last_cell)
            nearest.append(builder.select(axis.is_backward, high, low))
            spans.append(builder.sub(high, low))
        side = squares.sides(nearest[0], nearest[1], alive)
        distance_x, distance_y = (
            axis.distance(axis.border(cells, side)) for (axis, _), cells in zip(outer, nearest, strict=True)
        )
        is_y = builder.fcmp_ordered("<", distance_y, distance_x)
        leaving = builder.fsub(builder.select(is_y, distance_y, distance_x), inside)
        further = builder.fadd(distance, ir.Constant(REALS, [1.0] * GROUP))
        is_on = builder.and_(
            builder.icmp_signed(">", side, larger(builder, *spans)),
            builder.fcmp_unordered(">", leaving, further),
        )
        is_on = builder.and_(alive, is_on)
        distance = builder.select(is_on, leaving, distance)
        return (distance,), builder.and_(is_on, builder.fcmp_unordered("<", distance, reach))

    return advance


def _travel_bundles(
    typing_context: Any,  # noqa: ANN401
    squares: Any,  # noqa: ANN401
    shape: Any,  # noqa: ANN401
    origin: Any,  # noqa: ANN401
    inside: Any,  # noqa: ANN401
    bundles: Any,  # noqa: ANN401
    stride: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Write how far bundles of rays run through squares that hold them all.

    The seven rows of bundles (7, 32), so many bytes apart, hold the direction x, y of the first and of the
    last ray, their least inverses along x and y, signed, and the result. Rays stop ``inside`` before a
    border. The rest is as in ``travel_rays``.
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        squares, shape, origin, inside, bundles, stride = arguments
        x, y, reach = (builder.extract_value(origin, place) for place in range(3))
        reach, inside = spread(builder, reach, REALS), spread(builder, inside, REALS)
        advances, pointers = [], []
        for group in range(GROUPS):
            rows = Rows(builder, bundles, stride, group)
            across = Axis(builder, x, rows.load(0), rows.load(4))
            up = Axis(builder, y, rows.load(1), rows.load(5))
            outer = ((across, rows.load(2)), (up, rows.load(3)))
            table = Squares(builder, squares, shape, across, up)
            advances.append(_advance_bundles(builder, table, outer, reach, inside))
            pointers.append(rows.pointer(6))
        starts, alive = [(NO_REALS,)] * GROUPS, [ir.Constant(FLAGS, [1] * GROUP)] * GROUPS
        for end, pointer in zip(travel_groups(builder, starts, alive, advances), pointers, strict=True):
            builder.store(end, pointer, align=FLOAT)

    numbers = _numba_types.UniTuple(types.int64, 2), _numba_types.UniTuple(types.float64, 3)
    return types.void(types.int64, *numbers, types.float64, types.int64, types.int64), generate


travel_rays = machine_code(_travel_rays, plain_forms.travel_rays)
travel_bundles = machine_code(_travel_bundles, plain_forms.travel_bundles)
