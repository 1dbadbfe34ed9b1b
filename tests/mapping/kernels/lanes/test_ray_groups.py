"""What groups of lanes do in registers is what numpy does with arrays."""

import numpy as np
import pytest
from llvmlite import ir
from numba import types

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python.interpreted import array_at, machine_code
from lidarium.mapping.kernels.lanes.ray_groups import (
    BEHIND,
    FLAGS,
    GROUP,
    GROUPS,
    INT,
    INTS,
    NO_REALS,
    RAYS,
    REALS,
    Axis,
    Rows,
    Squares,
    larger,
    smaller,
    spread,
    travel_groups,
)


def ints_at(builder, address, row):
    place = builder.add(address, ir.Constant(address.type, 4 * GROUP * row))
    return builder.inttoptr(place, INTS.as_pointer())


# -- An axis ---------------------------------------------------------------------------------------------


def _axis_numbers(typing_context, start, numbers, sides, cells, distances):
    """Write cells at a distance, and the border of squares that open there, with the cells beside it."""

    def generate(_context, builder, _signature, arguments):
        start, numbers, sides, cells, distances = arguments
        rows = Rows(builder, numbers, ir.Constant(numbers.type, 8 * GROUP), 0)
        axis = Axis(builder, start, rows.load(0), rows.load(1))
        here = axis.cells(rows.load(2))
        border = axis.border(here, builder.load(ints_at(builder, sides, 0), align=4))
        for row, value in enumerate((here, border, axis.before(border), axis.behind(border))):
            builder.store(value, ints_at(builder, cells, row), align=4)
        builder.store(axis.distance(border), builder.inttoptr(distances, REALS.as_pointer()), align=8)

    return types.void(types.float64, *(types.int64,) * 4), generate


def plain_axis(start, numbers, sides, cells, distances):
    direction, inverse, distance = array_at(numbers, (3, GROUP), np.float64)
    is_back, side = direction < 0.0, array_at(sides, (GROUP,), np.int32)
    here = np.trunc(start + distance * direction).astype(np.int32)
    border = np.where(is_back, here + 1 - side, here + side)
    array_at(cells, (4, GROUP), np.int32)[:] = (
        here,
        border,
        np.where(is_back, border, border - 1),
        np.where(is_back, border - 1, border),
    )
    array_at(distances, (GROUP,), np.float64)[:] = (border - start) * inverse


axis_numbers = machine_code(_axis_numbers, plain_axis)


@kernel
def axis_at(start, numbers, sides, cells, distances):
    axis_numbers(start, numbers.ctypes.data, sides.ctypes.data, cells.ctypes.data, distances.ctypes.data)


@pytest.mark.parametrize("seed", range(5))
def test_an_axis_knows_the_cells_and_borders_of_rays_both_ways(seed):
    generator = np.random.default_rng(seed)
    direction = generator.uniform(0.1, 1.0, GROUP) * generator.choice([-1.0, 1.0], GROUP)
    numbers = np.stack([direction, 1.0 / direction, generator.uniform(0.0, 20.0, GROUP)])
    sides = generator.integers(1, 9, GROUP).astype(np.int32)
    found = np.zeros((4, GROUP), np.int32), np.zeros(GROUP)
    wanted = np.zeros((4, GROUP), np.int32), np.zeros(GROUP)
    axis_at(30.25, numbers, sides, *found)
    plain_axis(30.25, *(array.ctypes.data for array in (numbers, sides, *wanted)))
    for one, other in zip(found, wanted, strict=True):
        assert np.array_equal(one, other)
    assert (found[1] >= 0.0).all()


# -- The table of squares --------------------------------------------------------------------------------


def _sides_of(typing_context, table, shape, directions, cells, alive, sides):
    """Write the sides of the squares that open from cells."""

    def generate(_context, builder, _signature, arguments):
        table, shape, directions, cells, alive, sides = arguments
        rows = Rows(builder, directions, ir.Constant(directions.type, 8 * GROUP), 0)
        nothing = ir.Constant(ir.DoubleType(), 0.0)
        axes = [Axis(builder, nothing, rows.load(place), rows.load(place)) for place in range(2)]
        column, row = (builder.load(ints_at(builder, cells, place), align=4) for place in range(2))
        is_alive = builder.icmp_signed("!=", builder.load(ints_at(builder, alive, 0), align=4), ZEROS)
        found = Squares(builder, table, shape, *axes).sides(column, row, is_alive)
        builder.store(found, ints_at(builder, sides, 0), align=4)

    return types.void(types.int64, types.UniTuple(types.int64, 2), *(types.int64,) * 4), generate


ZEROS = ir.Constant(INTS, [0] * GROUP)


def plain_sides(table, shape, directions, cells, alive, sides):
    plane, columns = shape
    across, up = array_at(directions, (2, GROUP), np.float64)
    column, row = array_at(cells, (2, GROUP), np.int32)
    squares = array_at(table, (4, plane), np.uint8)
    numbers = (across < 0.0).astype(int) + 2 * (up < 0.0)
    found = squares[numbers, row * columns + column]
    array_at(sides, (GROUP,), np.int32)[:] = np.where(array_at(alive, (GROUP,), np.int32), found, 0)


sides_of = machine_code(_sides_of, plain_sides)


@kernel
def sides_at(table, shape, directions, cells, alive, sides):
    addresses = cells.ctypes.data, alive.ctypes.data, sides.ctypes.data
    sides_of(table.ctypes.data, shape, directions.ctypes.data, addresses[0], addresses[1], addresses[2])


@pytest.mark.parametrize("seed", range(5))
def test_squares_are_looked_up_by_direction_and_dead_lanes_find_none(seed):
    generator = np.random.default_rng(seed)
    rows, columns = generator.integers(5, 40, 2).tolist()
    table = np.concatenate([generator.integers(1, 256, 4 * rows * columns), np.zeros(BEHIND)]).astype(
        np.uint8
    )
    directions = generator.choice([-1.0, 1.0], (2, GROUP))
    cells = np.stack([generator.integers(0, columns, GROUP), generator.integers(0, rows, GROUP)])
    # The last cell of all, behind which other bytes are read along.
    cells[:, 0], directions[:, 0] = (columns - 1, rows - 1), -1.0
    cells, alive = cells.astype(np.int32), generator.integers(0, 2, GROUP).astype(np.int32)
    alive[:2] = 1, 0
    found, wanted = np.full(GROUP, -1, np.int32), np.full(GROUP, -1, np.int32)
    sides_at(table, (rows * columns, columns), directions, cells, alive, found)
    addresses = (array.ctypes.data for array in (directions, cells, alive, wanted))
    plain_sides(table.ctypes.data, (rows * columns, columns), *addresses)
    assert np.array_equal(found, wanted)
    assert (found > 0).any()


# -- Lanes that travel -----------------------------------------------------------------------------------


def _count_to(typing_context, limits, ends):
    """Count up each lane of all groups to its limit."""

    def generate(_context, builder, _signature, arguments):
        limits, ends = arguments
        stride, ones = ir.Constant(limits.type, 8 * RAYS), ir.Constant(REALS, [1.0] * GROUP)
        rows = [Rows(builder, limits, stride, group).load(0) for group in range(GROUPS)]

        def counting(most):
            def advance(state, alive):
                (value,) = state
                value = builder.select(alive, builder.fadd(value, ones), value)
                return (value,), builder.and_(alive, builder.fcmp_ordered("<", value, most))

            return advance

        alive = [builder.fcmp_ordered("<", NO_REALS, most) for most in rows]
        assert all(each.type == FLAGS for each in alive)
        starts = [(NO_REALS,)] * GROUPS
        for group, end in enumerate(travel_groups(builder, starts, alive, [counting(most) for most in rows])):
            builder.store(end, Rows(builder, ends, stride, group).pointer(0), align=8)

    return types.void(types.int64, types.int64), generate


def plain_count(limits, ends):
    array_at(ends, (RAYS,), np.float64)[:] = np.maximum(np.ceil(array_at(limits, (RAYS,), np.float64)), 0.0)


count_to = machine_code(_count_to, plain_count)


@kernel
def count_at(limits, ends):
    count_to(limits.ctypes.data, ends.ctypes.data)


def test_groups_travel_until_no_lane_is_alive_and_dead_lanes_wait():
    limits, ends = np.random.default_rng(0).uniform(-5.0, 40.0, RAYS), np.full(RAYS, -1.0)
    count_at(limits, ends)
    assert ends.tolist() == np.maximum(np.ceil(limits), 0.0).tolist()
    # One group ends long before the other.
    limits[:GROUP], limits[GROUP:] = 1.0, np.arange(GROUP)
    count_at(limits, ends)
    assert ends.tolist() == [1.0] * GROUP + list(range(GROUP))
    count_at(np.full(RAYS, -3.0), ends)
    assert not ends.any()


# -- Numbers in all lanes --------------------------------------------------------------------------------


def _between(typing_context, low, high, numbers):
    """Bring integers between two numbers."""

    def generate(_context, builder, _signature, arguments):
        low, high, numbers = arguments
        low, high = (spread(builder, builder.trunc(value, INT), INTS) for value in (low, high))
        place = ints_at(builder, numbers, 0)
        value = smaller(builder, larger(builder, builder.load(place, align=4), low), high)
        builder.store(value, place, align=4)

    return types.void(*(types.int64,) * 3), generate


def plain_between(low, high, numbers):
    array_at(numbers, (GROUP,), np.int32)[:] = np.clip(array_at(numbers, (GROUP,), np.int32), low, high)


between = machine_code(_between, plain_between)


@kernel
def between_at(low, high, numbers):
    between(low, high, numbers.ctypes.data)


def test_the_larger_and_the_smaller_of_signed_numbers_are_taken_in_each_lane():
    numbers = np.arange(-8, 8, dtype=np.int32)
    between_at(-3, 5, numbers)
    assert numbers.tolist() == np.clip(np.arange(-8, 8), -3, 5).tolist()
