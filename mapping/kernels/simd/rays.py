"""Rays, and bundles of rays, that travel through the empty squares of a floor 32 at once.

They are two groups of sixteen: while one waits for a look-up, the other goes on. Each lane does the
arithmetic of the definition in its order, so that both give the same to the bit.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numpy.typing import NDArray

from lidarium.mapping.kernels.llvm import (
    INT,
    Builder,
    Value,
    any_of,
    constant,
    gather,
    llvm_overload,
    load_at,
    max_lanes,
    min_lanes,
    numba_types,
    splat,
    store_at,
    vector,
)
from lidarium.mapping.kernels.views import array_at, vector_at

GROUP = 16
"""Lanes of a group."""

RAYS = 2 * GROUP
"""Rays, or bundles, that travel at once."""

FLOAT = 8
"""Bytes of a float64."""

BEHIND = 3
"""Bytes after the table of squares that are read, and not used."""

_INTS, _REALS, _FLAGS = vector(INT, GROUP), vector(ir.DoubleType(), GROUP), vector(ir.IntType(1), GROUP)
_ZEROS, _ONES, _BYTE = (constant(_INTS, number) for number in (0, 1, 255))
_PAIR, _TRIPLE = numba_types.UniTuple(types.int64, 2), numba_types.UniTuple(types.float64, 3)

Advance = Callable[[Any, Any], tuple[Any, Any]]


# -- Definitions -------------------------------------------------------------------------------------------


def travel_rays(
    squares: int,
    shape: tuple[int, int],
    origin: tuple[float, float, float],
    together: int,
    directions: int,
    stride: int,
    ranges: int,
) -> None:
    """Write the distances at which 32 rays enter a solid cell, at most the reach. All in cells."""
    table = _squares(squares, shape)
    rows = np.array([vector_at(directions + k * stride, RAYS, np.float64) for k in range(4)])
    free, found = vector_at(together, RAYS // GROUP, np.float64), vector_at(ranges, RAYS, np.float64)
    for ray in range(RAYS):
        found[ray] = _end_of_ray(table, origin, rows[:, ray].tolist(), float(free[ray // GROUP]))


def travel_bundles(
    squares: int,
    shape: tuple[int, int],
    origin: tuple[float, float, float],
    inside: float,
    bundles: int,
    stride: int,
) -> None:
    """Write how far 32 bundles of rays run through squares that hold them all.

    The seven rows of bundles (7, 32), ``stride`` bytes apart, hold the direction x, y of the first and of the last
    ray, their smallest inverses along x and y, signed, and the result. Rays stop ``inside`` before a border. The
    rest is as in ``travel_rays``.
    """
    table = _squares(squares, shape)
    rows = [vector_at(bundles + k * stride, RAYS, np.float64) for k in range(7)]
    for bundle in range(RAYS):
        outer = [float(row[bundle]) for row in rows[:6]]
        rows[6][bundle] = _end_of_bundle(table, origin, outer, inside)


def _squares(address: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    plane, columns = shape
    return array_at(address, (4, plane // columns, columns), np.uint8)


def _end_of_ray(
    squares: NDArray[np.uint8], origin: tuple[float, float, float], direction: list[float], distance: float
) -> float:
    """Return the distance at which a ray, free up to ``distance``, enters a solid cell, or the reach."""
    *start, reach = origin
    along, inverse = direction[:2], direction[2:]
    step = [-1 if each < 0.0 else 1 for each in along]
    table = squares[(step[0] < 0) + 2 * (step[1] < 0)]
    cell = [int(start[k] + distance * along[k]) for k in range(2)]
    while distance < reach:
        side = int(table[cell[1], cell[0]])
        if side == 0:
            break
        last = [cell[k] + step[k] * (side - 1) for k in range(2)]
        borders = [(last[k] + (step[k] > 0) - start[k]) * inverse[k] for k in range(2)]
        left, crossed = (0, 1) if borders[0] <= borders[1] else (1, 0)
        distance = max(distance, borders[left])
        if distance < reach:
            reached = int(start[crossed] + distance * along[crossed])
            low, high = sorted((cell[crossed], last[crossed]))
            cell[left], cell[crossed] = last[left] + step[left], min(max(reached, low), high)
    return min(distance, reach)


def _end_of_bundle(
    squares: NDArray[np.uint8], origin: tuple[float, float, float], outer: list[float], inside: float
) -> float:
    """Return how far the rays between two outer ones run through squares that hold them all."""
    *start, reach = origin
    step = [-1 if each < 0.0 else 1 for each in outer[:2]]
    table = squares[(step[0] < 0) + 2 * (step[1] < 0)]
    distance = 0.0
    while True:
        cells = [
            sorted((int(start[k] + distance * outer[k]), int(start[k] + distance * outer[2 + k]))) for k in range(2)
        ]
        near = [cells[k][0 if step[k] > 0 else 1] for k in range(2)]
        side = int(table[near[1], near[0]])
        borders = [(near[k] + step[k] * (side - 1) + (step[k] > 0) - start[k]) * outer[4 + k] for k in range(2)]
        leaving = min(borders) - inside
        if side <= max(high - low for low, high in cells) or leaving <= distance + 1.0:
            return distance
        distance = leaving
        if distance >= reach:
            return distance


# -- Words of the text -------------------------------------------------------------------------------------


def _cells_at(builder: Builder, start: Value, direction: Value, distance: Value) -> Value:
    """Return the cells at a distance along rays, on one axis."""
    return builder.fptosi(builder.fadd(start, builder.fmul(distance, direction)), _INTS)


class _Axis:
    """One axis of a group: the start of its rays, and their directions and inverses along it."""

    def __init__(self, builder: Builder, start: Value, direction: Value, inverse: Value) -> None:
        self._builder, self._inverse = builder, inverse
        self.start = splat(builder, start, _REALS)
        self.direction = direction
        self.is_backward = builder.fcmp_ordered("<", direction, constant(_REALS, 0.0))
        # -1 for backward and 0 for forward: it turns a number of cells around, and makes steps of it.
        self.turn = builder.sext(self.is_backward, _INTS)
        self._forward = builder.add(self.turn, _ONES)

    def cells(self, distance: Value) -> Value:
        """Return the cells at a distance along the rays."""
        return _cells_at(self._builder, self.start, self.direction, distance)

    def border(self, cells: Value, side: Value) -> Value:
        """Return the far borders of squares that open from cells."""
        # side - 1 forward and -side backward: one more is the border as seen from the cell.
        ahead = self._builder.xor(self._builder.sub(side, _ONES), self.turn)
        return self._builder.add(self._builder.add(cells, _ONES), ahead)

    def distance(self, border: Value) -> Value:
        """Return the distances at which the rays are at borders."""
        line = self._builder.sitofp(border, _REALS)
        return self._builder.fmul(self._builder.fsub(line, self.start), self._inverse)

    def before(self, border: Value) -> Value:
        """Return the cells before borders."""
        return self._builder.sub(border, self._forward)

    def behind(self, border: Value) -> Value:
        """Return the cells behind borders."""
        return self._builder.add(border, self.turn)


class _Squares:
    """The four planes of squares, as the lanes of a group look them up."""

    def __init__(self, builder: Builder, address: Value, shape: Value, across: _Axis, up: _Axis) -> None:
        plane, self._columns = (splat(builder, builder.extract_value(shape, k), _INTS) for k in range(2))
        self._builder, self._address = builder, address
        left, down = builder.and_(across.turn, plane), builder.and_(up.turn, builder.add(plane, plane))
        self._offset = builder.add(left, down)

    def sides(self, column: Value, row: Value, alive: Value) -> Value:
        """Return the side of the largest square that opens from each lane's cell."""
        within = self._builder.add(self._builder.mul(row, self._columns), column)
        offsets = self._builder.add(self._offset, within)
        return self._builder.and_(gather(self._builder, self._address, offsets, alive), _BYTE)


def _rows_of_group(builder: Builder, address: Value, stride: Value, group: int) -> list[Value]:
    """Return the addresses of a group's numbers in seven rows that are ``stride`` bytes apart."""
    rows = [builder.add(address, ir.Constant(address.type, group * GROUP * FLOAT))]
    while len(rows) < 7:
        rows.append(builder.add(rows[-1], stride))
    return rows


def _travel(
    builder: Builder,
    starts: Sequence[Sequence[Value]],
    alive: Sequence[Value],
    advances: Sequence[Advance],
) -> list[Value]:
    """Advance two groups while a lane is alive; return the first number of each group's state."""

    def is_any_alive(masks: Sequence[Value]) -> Value:
        return any_of(builder, functools.reduce(builder.or_, masks))

    before = builder.basic_block
    loop, after = builder.append_basic_block("travel"), builder.append_basic_block("arrived")
    builder.cbranch(is_any_alive(alive), loop, after)
    builder.position_at_end(loop)
    states = [[builder.phi(value.type) for value in start] for start in starts]
    masks = [builder.phi(_FLAGS) for _ in alive]
    moved = [advance(*each) for advance, *each in zip(advances, states, masks, strict=True)]
    builder.cbranch(is_any_alive([mask for _, mask in moved]), loop, after)
    builder.position_at_end(after)
    ends = []
    for (new, new_mask), state, mask, start, first in zip(moved, states, masks, starts, alive, strict=True):
        for phi, old, value in zip([*state, mask], [*start, first], [*new, new_mask], strict=True):
            phi.add_incoming(old, before)
            phi.add_incoming(value, loop)
        end = builder.phi(_REALS)
        end.add_incoming(start[0], before)
        end.add_incoming(new[0], loop)
        ends.append(end)
    return ends


# -- Rays --------------------------------------------------------------------------------------------------


def _advance_rays(builder: Builder, squares: _Squares, across: _Axis, up: _Axis, reach: Value) -> Advance:
    """Return how rays (distance, column, row) move through one square."""

    def advance(state: Value, alive: Value) -> tuple[Value, Value]:
        distance, column, row = state
        side = squares.sides(column, row, alive)
        is_free = builder.icmp_signed("!=", side, _ZEROS)
        border_x, border_y = across.border(column, side), up.border(row, side)
        distance_x, distance_y = across.distance(border_x), up.distance(border_y)
        is_x = builder.fcmp_ordered("<=", distance_x, distance_y)
        # Each of the two is one instruction: the rest waits for them, and not for a comparison.
        is_less = builder.fcmp_ordered("<", distance_x, distance_y)
        nearest = builder.select(is_less, distance_x, distance_y)
        further = builder.select(builder.fcmp_ordered(">", nearest, distance), nearest, distance)
        start, direction = (
            builder.select(is_x, getattr(up, name), getattr(across, name)) for name in ("start", "direction")
        )
        crossed = _cells_at(builder, start, direction, further)
        own = builder.select(is_x, row, column)
        last = builder.select(is_x, up.before(border_y), across.before(border_x))
        low, high = min_lanes(builder, own, last), max_lanes(builder, own, last)
        inside = min_lanes(builder, max_lanes(builder, crossed, low), high)
        column = builder.select(is_x, across.behind(border_x), inside)
        row = builder.select(is_x, inside, up.behind(border_y))
        distance = builder.select(is_free, further, distance)
        is_on = builder.and_(is_free, builder.fcmp_ordered("<", distance, reach))
        return (distance, column, row), builder.and_(alive, is_on)

    return advance


@llvm_overload(travel_rays, types.void, types.int64, _PAIR, _TRIPLE, *(types.int64,) * 4)
def _(
    builder: Builder,
    squares: Value,
    shape: Value,
    origin: Value,
    together: Value,
    directions: Value,
    stride: Value,
    ranges: Value,
) -> Value:
    x, y, reach = (builder.extract_value(origin, k) for k in range(3))
    reach = splat(builder, reach, _REALS)
    starts, alive, advances = [], [], []
    for group in range(RAYS // GROUP):
        rows = _rows_of_group(builder, directions, stride, group)
        numbers = [load_at(builder, row, _REALS) for row in rows[:4]]
        across, up = _Axis(builder, x, *numbers[::2]), _Axis(builder, y, *numbers[1::2])
        start = splat(builder, load_at(builder, together, _REALS.element, group * FLOAT), _REALS)
        starts.append((start, across.cells(start), up.cells(start)))
        alive.append(builder.fcmp_ordered("<", start, reach))
        table = _Squares(builder, squares, shape, across, up)
        advances.append(_advance_rays(builder, table, across, up, reach))
    for group, end in enumerate(_travel(builder, starts, alive, advances)):
        is_short = builder.fcmp_ordered("<", reach, end)
        store_at(builder, builder.select(is_short, reach, end), ranges, group * GROUP * FLOAT)


# -- Bundles -----------------------------------------------------------------------------------------------


def _advance_bundles(
    builder: Builder, squares: _Squares, outer: Sequence[tuple[_Axis, Value]], reach: Value, inside: Value
) -> Advance:
    """Return how bundles (distance,) move through one square, by their axes and last rays."""

    def advance(state: Value, alive: Value) -> tuple[Value, Value]:
        (distance,) = state
        nearest, spans = [], []
        for axis, last in outer:
            first_cell, last_cell = axis.cells(distance), _cells_at(builder, axis.start, last, distance)
            low, high = min_lanes(builder, first_cell, last_cell), max_lanes(builder, first_cell, last_cell)
            nearest.append(builder.select(axis.is_backward, high, low))
            spans.append(builder.sub(high, low))
        side = squares.sides(nearest[0], nearest[1], alive)
        distance_x, distance_y = (
            axis.distance(axis.border(cells, side)) for (axis, _), cells in zip(outer, nearest, strict=True)
        )
        is_y = builder.fcmp_ordered("<", distance_y, distance_x)
        leaving = builder.fsub(builder.select(is_y, distance_y, distance_x), inside)
        further = builder.fadd(distance, constant(_REALS, 1.0))
        is_on = builder.and_(
            builder.icmp_signed(">", side, max_lanes(builder, *spans)),
            builder.fcmp_unordered(">", leaving, further),
        )
        is_on = builder.and_(alive, is_on)
        distance = builder.select(is_on, leaving, distance)
        return (distance,), builder.and_(is_on, builder.fcmp_unordered("<", distance, reach))

    return advance


@llvm_overload(travel_bundles, types.void, types.int64, _PAIR, _TRIPLE, types.float64, types.int64, types.int64)
def _(
    builder: Builder,
    squares: Value,
    shape: Value,
    origin: Value,
    inside: Value,
    bundles: Value,
    stride: Value,
) -> Value:
    x, y, reach = (builder.extract_value(origin, k) for k in range(3))
    reach, inside = splat(builder, reach, _REALS), splat(builder, inside, _REALS)
    advances, targets = [], []
    for group in range(RAYS // GROUP):
        rows = _rows_of_group(builder, bundles, stride, group)
        first_x, first_y, last_x, last_y, inverse_x, inverse_y = (load_at(builder, row, _REALS) for row in rows[:6])
        across, up = _Axis(builder, x, first_x, inverse_x), _Axis(builder, y, first_y, inverse_y)
        table = _Squares(builder, squares, shape, across, up)
        advances.append(_advance_bundles(builder, table, ((across, last_x), (up, last_y)), reach, inside))
        targets.append(rows[6])
    count = len(advances)
    starts, alive = [(constant(_REALS, 0.0),)] * count, [constant(_FLAGS, 1)] * count
    for end, target in zip(_travel(builder, starts, alive, advances), targets, strict=True):
        store_at(builder, end, target)
