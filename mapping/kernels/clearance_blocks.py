"""Operations of the clearance on blocks of 64 cells at once.

Steps to occupied cells, their squares, and the nearest; see ``cell_blocks``.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python import plain_forms
from lidarium.mapping.kernels.in_python.interpreted import machine_code
from lidarium.mapping.kernels.vectors import (
    BLOCK,
    BYTES,
    INT16,
    INT64,
    NO_BYTES,
    NO_SHORTS,
    SHORTS,
    alloca,
    call_vectors,
    load_at,
    splat,
    store_at,
)


def _positive_differs(typing_context: Any, log_odds: Any, numbers: Any, number: Any) -> Any:  # noqa: ANN401
    """Return in which cells only one of two conditions holds.

    The log-odds are positive, or the number is the given one.
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        beliefs_at, numbers_at, value = arguments
        is_positive = builder.icmp_signed(">", load_at(builder, beliefs_at, BYTES), NO_BYTES)
        is_number = builder.icmp_signed(
            "==", load_at(builder, numbers_at, SHORTS), splat(builder, value, SHORTS)
        )
        return builder.bitcast(builder.xor(is_positive, is_number), INT64)

    return types.uint64(*(types.int64,) * 3), generate


def _count_rows(
    typing_context: Any,  # noqa: ANN401
    log_odds: Any,  # noqa: ANN401
    stride: Any,  # noqa: ANN401
    rows: Any,  # noqa: ANN401
    steps: Any,  # noqa: ANN401
    largest: Any,  # noqa: ANN401
    fewest: Any,  # noqa: ANN401
    width: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Count the steps in each lane, row by row, up to the largest number.

    The count starts again at 0 where the log-odds are positive.
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        beliefs_at, stride, rows, steps_at, most, fewest_at, width = arguments
        none, one = ir.Constant(INT64, 0), ir.Constant(INT64, 1)
        largest, counted = splat(builder, most, SHORTS), alloca(builder, load_at(builder, steps_at, SHORTS))
        with cgutils.for_range_slice(builder, none, rows, one, intp=INT64) as (k, _):
            beliefs = load_at(builder, builder.add(beliefs_at, builder.mul(k, stride)), BYTES)
            more = call_vectors(
                builder, "umin", builder.add(builder.load(counted), ir.Constant(SHORTS, [1] * BLOCK)), largest
            )
            now = builder.select(builder.icmp_signed(">", beliefs, NO_BYTES), NO_SHORTS, more)
            builder.store(now, counted)
            target = builder.add(fewest_at, builder.mul(k, width))
            store_at(builder, call_vectors(builder, "umin", now, load_at(builder, target, SHORTS)), target)
        store_at(builder, builder.load(counted), steps_at)

    return types.void(*(types.int64,) * 7), generate


def _squares(typing_context: Any, steps: Any, far: Any, cap: Any, result: Any) -> Any:  # noqa: ANN401
    """Write the squared distances in half cells after some steps; return the fewest."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        steps_at, far, cap, result_at = arguments
        steps = load_at(builder, steps_at, SHORTS)
        half_cells = call_vectors(
            builder, "usub.sat", builder.add(steps, steps), ir.Constant(SHORTS, [1] * BLOCK)
        )
        caps, is_near = (
            splat(builder, cap, SHORTS),
            builder.icmp_unsigned("<", steps, splat(builder, far, SHORTS)),
        )
        squares = call_vectors(builder, "umin", builder.mul(half_cells, half_cells), caps)
        store_at(builder, builder.select(is_near, squares, caps), result_at)
        insert: Any = cgutils.get_or_insert_function
        function = insert(
            builder.module, ir.FunctionType(INT16, [SHORTS]), f"llvm.vector.reduce.umin.v{BLOCK}i16"
        )
        return builder.zext(builder.call(function, [steps]), INT64)

    return types.int64(*(types.int64,) * 4), generate


def _least_sums(
    typing_context: Any,  # noqa: ANN401
    numbers: Any,  # noqa: ANN401
    costs: Any,  # noqa: ANN401
    low: Any,  # noqa: ANN401
    high: Any,  # noqa: ANN401
    cap: Any,  # noqa: ANN401
    result: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Write cap - min(cap, numbers[j + k] + costs[k]) for the lanes j.

    The minimum is over k from low to high.
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        numbers_at, costs_at, first, last, most, result_at = arguments
        caps = splat(builder, most, SHORTS)
        least = alloca(builder, caps)
        with cgutils.for_range_slice(builder, first, last, ir.Constant(INT64, 1), intp=INT64) as (k, _):
            offset = builder.shl(k, ir.Constant(INT64, 1))
            number = load_at(builder, builder.add(numbers_at, offset), SHORTS)
            cost = splat(builder, load_at(builder, builder.add(costs_at, offset), INT16), SHORTS)
            builder.store(
                call_vectors(builder, "umin", builder.load(least), builder.add(number, cost)), least
            )
        store_at(builder, builder.sub(caps, builder.load(least)), result_at)

    return types.void(*(types.int64,) * 6), generate


def _same_block(typing_context: Any, block: Any, other: Any) -> Any:  # noqa: ANN401
    """Tell which numbers of two blocks are the same, and not 0."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        one, two = (load_at(builder, address, SHORTS) for address in arguments)
        is_same = builder.and_(builder.icmp_signed("==", one, two), builder.icmp_signed("!=", two, NO_SHORTS))
        return builder.bitcast(is_same, INT64)

    return types.uint64(types.int64, types.int64), generate


def _raise_block(typing_context: Any, block: Any, other: Any) -> Any:  # noqa: ANN401
    """Raise the numbers of a block to those of another where these are greater."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        store_at(
            builder,
            call_vectors(builder, "umax", *(load_at(builder, address, SHORTS) for address in arguments)),
            arguments[0],
        )

    return types.void(types.int64, types.int64), generate


_differs = machine_code(_positive_differs, plain_forms.cells_that_differ)
_count = machine_code(_count_rows, plain_forms.count_rows)
_square = machine_code(_squares, plain_forms.write_squares)
_least = machine_code(_least_sums, plain_forms.write_least_sums)
_raise = machine_code(_raise_block, plain_forms.raise_block)
_same = machine_code(_same_block, plain_forms.same_cells)


@kernel(inline=True)
def cells_that_differ(log_odds: int, numbers: int, number: int) -> np.uint64:
    """Return in which cells of two blocks, int8 and uint16, only one is true.

    The log-odds are positive, or the other is ``number``.
    """
    cells: np.uint64 = _differs(log_odds, numbers, number)
    return cells


@kernel(inline=True)
def count_rows(
    log_odds: int, stride: int, rows: int, steps: int, largest: int, fewest: int, width: int
) -> None:
    """Count the rows since the last occupied cell of each of 64 columns.

    Row by row; the fewest that each place has had are kept.

    Parameters
    ----------
    log_odds, stride, rows : int
        Where the first row's block of int8 lies, how many bytes on the next one, less than 0 for the way
        back, and how many there are.
    steps : int
        A block of uint16 with the steps before the first row, and after the last one in the end: one more in
        each row up to ``largest``, 0 where log-odds are positive.
    fewest, width : int
        Where the block of uint16 of the first row lies that is lowered to the steps, and how many bytes on
        the next one.
    """
    _count(log_odds, stride, rows, steps, largest, fewest, width)


@kernel(inline=True)
def write_squares(steps: int, far: int, cap: int, result: int) -> int:
    """Write squared distances [half cells] of a uint16 block of steps in cells.

    Returns the fewest steps.

    From ``far`` steps on it is ``cap``, which it never exceeds; (2 ``far`` - 1) ^ 2 must fit into 16 bits.
    """
    fewest: int = _square(steps, far, cap, result)
    return fewest


@kernel(inline=True)
def write_least_sums(numbers: int, costs: int, low: int, high: int, cap: int, result: int) -> None:
    """Write ``cap`` less the least of ``numbers[j + k] + costs[k]``, for 64 cells j.

    The least is over k from ``low`` to ``high``; the result is not negative.

    All are uint16, of which no sum may exceed 65,535; high ends excluded.
    """
    _least(numbers, costs, low, high, cap, result)


@kernel(inline=True)
def raise_block(block: int, other: int) -> None:
    """Raise the uint16 of a block to those of another where these are greater."""
    _raise(block, other)


@kernel(inline=True)
def same_cells(block: int, other: int) -> np.uint64:
    """Tell which uint16 of two blocks are the same, and not 0."""
    cells: np.uint64 = _same(block, other)
    return cells
