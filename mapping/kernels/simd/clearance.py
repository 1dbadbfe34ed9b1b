"""Operations of the clearance on blocks of 64 cells: steps to occupied cells, their squares, and the nearest.

Log-odds are int8 and all other numbers uint16, at addresses.
"""

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.llvm import (
    BLOCK,
    LONG,
    Builder,
    Value,
    bits_of_lanes,
    call,
    constant,
    lanewise,
    llvm_overload,
    load_at,
    splat,
    stack_slot,
    store_at,
)
from lidarium.mapping.kernels.simd.cells import BYTES, NO_BYTES, NO_SHORTS, SHORTS
from lidarium.mapping.kernels.simd.words import bits_of
from lidarium.mapping.kernels.views import vector_at

_SHORT = ir.IntType(16)


def cells_that_differ(log_odds: int, numbers: int, number: int) -> np.uint64:
    """Return the cells in which only one is true: the log-odds are positive, or the other is ``number``."""
    is_positive = vector_at(log_odds, BLOCK, np.int8) > 0
    return bits_of(is_positive != (vector_at(numbers, BLOCK, np.uint16) == number))


@llvm_overload(cells_that_differ, types.uint64, *(types.int64,) * 3)
def _(builder: Builder, log_odds: Value, numbers: Value, number: Value) -> Value:
    is_positive = builder.icmp_signed(">", load_at(builder, log_odds, BYTES), NO_BYTES)
    lanes = load_at(builder, numbers, SHORTS)
    is_number = builder.icmp_signed("==", lanes, splat(builder, number, SHORTS))
    return bits_of_lanes(builder, builder.xor(is_positive, is_number))


def count_rows(log_odds: int, stride: int, rows: int, steps: int, maximum: int, minima: int, width: int) -> None:
    """Count the rows since the last occupied cell of each of 64 columns, row by row."""
    counted = vector_at(steps, BLOCK, np.uint16)
    for row in range(rows):
        is_occupied = vector_at(log_odds + row * stride, BLOCK, np.int8) > 0
        counted[:] = np.where(is_occupied, 0, np.minimum(counted.astype(int) + 1, maximum))
        lowered = vector_at(minima + row * width, BLOCK, np.uint16)
        lowered[:] = np.minimum(lowered, counted)


@llvm_overload(count_rows, types.void, *(types.int64,) * 7)
def _(
    builder: Builder,
    log_odds: Value,
    stride: Value,
    rows: Value,
    steps: Value,
    maximum: Value,
    minima: Value,
    width: Value,
) -> Value:
    none, one = ir.Constant(LONG, 0), ir.Constant(LONG, 1)
    bound, counted = splat(builder, maximum, SHORTS), stack_slot(builder, load_at(builder, steps, SHORTS))
    with cgutils.for_range_slice(builder, none, rows, one, intp=LONG) as (k, _):
        cells = load_at(builder, builder.add(log_odds, builder.mul(k, stride)), BYTES)
        more = lanewise(builder, "umin", builder.add(builder.load(counted), constant(SHORTS, 1)), bound)
        now = builder.select(builder.icmp_signed(">", cells, NO_BYTES), NO_SHORTS, more)
        builder.store(now, counted)
        target = builder.add(minima, builder.mul(k, width))
        store_at(builder, lanewise(builder, "umin", now, load_at(builder, target, SHORTS)), target)
    store_at(builder, builder.load(counted), steps)


def write_squares(steps: int, far: int, cap: int, result: int) -> int:
    """Write squared distances [half cells] of a block of steps [cells]; return the fewest steps.

    They are at most ``cap``, and ``cap`` from ``far`` steps on; (2 ``far`` - 1) ^ 2 must fit into 16 bits.
    """
    counted = np.array(vector_at(steps, BLOCK, np.uint16), int)
    squares = np.minimum(np.maximum(2 * counted - 1, 0) ** 2, cap)
    vector_at(result, BLOCK, np.uint16)[:] = np.where(counted < far, squares, cap)
    return int(counted.min())


@llvm_overload(write_squares, types.int64, *(types.int64,) * 4)
def _(builder: Builder, steps: Value, far: Value, cap: Value, result: Value) -> Value:
    counted, caps = load_at(builder, steps, SHORTS), splat(builder, cap, SHORTS)
    half_cells = lanewise(builder, "usub.sat", builder.add(counted, counted), constant(SHORTS, 1))
    is_near = builder.icmp_unsigned("<", counted, splat(builder, far, SHORTS))
    squares = lanewise(builder, "umin", builder.mul(half_cells, half_cells), caps)
    store_at(builder, builder.select(is_near, squares, caps), result)
    return builder.zext(call(builder, f"llvm.vector.reduce.umin.v{BLOCK}i16", _SHORT, counted), LONG)


def write_min_sums(numbers: int, costs: int, low: int, high: int, cap: int, result: int) -> None:
    """Write ``cap`` less the minimum of ``numbers[j + k] + costs[k]`` over ``low <= k < high``, for 64 j.

    The result is not negative. No sum may exceed 65,535.
    """
    count = max(high - low, 0)
    given = vector_at(numbers + 2 * low, count + BLOCK - 1, np.uint16).astype(int)
    added = vector_at(costs + 2 * low, count, np.uint16)
    sums = [given[k : k + BLOCK] + int(added[k]) for k in range(count)]
    vector_at(result, BLOCK, np.uint16)[:] = cap - np.min([np.full(BLOCK, cap), *sums], axis=0)


@llvm_overload(write_min_sums, types.void, *(types.int64,) * 6)
def _(builder: Builder, numbers: Value, costs: Value, low: Value, high: Value, cap: Value, result: Value) -> Value:
    caps = splat(builder, cap, SHORTS)
    minimum = stack_slot(builder, caps)
    with cgutils.for_range_slice(builder, low, high, ir.Constant(LONG, 1), intp=LONG) as (k, _):
        offset = builder.shl(k, ir.Constant(LONG, 1))
        number = load_at(builder, builder.add(numbers, offset), SHORTS)
        cost = splat(builder, load_at(builder, builder.add(costs, offset), _SHORT), SHORTS)
        total = builder.add(number, cost)
        builder.store(lanewise(builder, "umin", builder.load(minimum), total), minimum)
    store_at(builder, builder.sub(caps, builder.load(minimum)), result)


@kernel(forceinline=True, nrt=False)
def raise_block(block: int, other: int) -> None:
    """Raise the numbers of a block to those of another if these are greater; numba's vectors are as fast."""
    raised, others = vector_at(block, BLOCK, np.uint16), vector_at(other, BLOCK, np.uint16)
    for k in range(BLOCK):
        raised[k] = max(raised[k], others[k])


def same_cells(block: int, other: int) -> np.uint64:
    """Return which numbers of two blocks are the same, and not 0."""
    one, two = (vector_at(address, BLOCK, np.uint16) for address in (block, other))
    return bits_of((one == two) & (two != 0))


@llvm_overload(same_cells, types.uint64, types.int64, types.int64)
def _(builder: Builder, block: Value, other: Value) -> Value:
    one, two = (load_at(builder, address, SHORTS) for address in (block, other))
    is_same = builder.and_(builder.icmp_signed("==", one, two), builder.icmp_signed("!=", two, NO_SHORTS))
    return bits_of_lanes(builder, is_same)
