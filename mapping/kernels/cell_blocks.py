"""Operations on blocks of 64 cells of log-odds and distances at once.

Kernels use them to process cells by the word.

A word of bits says which cells of a block are meant. LLVM turns the operations on vectors of 64 numbers into
what the machine has, whatever the width of its registers; numba cannot write them as loops, since it keeps no
bit per lane and unrolls loops of a known length before it could run them on vectors. Blocks are given by
their address; the caller sees to it that all 64 cells lie within the array.
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
    INT64,
    LEVELS,
    MASK,
    NO_BYTES,
    alloca,
    call_vectors,
    load_at,
    splat,
    store_at,
)

HALF_BLOCK = 32
"""Cells of which levels are written at a time where there are fewer than a block."""


def _update_block(
    typing_context: Any,  # noqa: ANN401
    address: Any,  # noqa: ANN401
    seen: Any,  # noqa: ANN401
    hits: Any,  # noqa: ANN401
    hit: Any,  # noqa: ANN401
    miss: Any,  # noqa: ANN401
    minimum: Any,  # noqa: ANN401
    maximum: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Lower the seen cells of a block and raise the hit ones."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        place, seen_bits, hit_bits, hit_step, miss_step, least, greatest = arguments
        old = load_at(builder, place, BYTES)
        lowered = call_vectors(builder, "ssub.sat", old, splat(builder, miss_step, BYTES))
        lowered = call_vectors(builder, "smax", lowered, splat(builder, least, BYTES))
        raised = call_vectors(builder, "sadd.sat", old, splat(builder, hit_step, BYTES))
        raised = call_vectors(builder, "smin", raised, splat(builder, greatest, BYTES))
        missed = builder.select(builder.bitcast(seen_bits, MASK), lowered, old)
        new = builder.select(builder.bitcast(hit_bits, MASK), raised, missed)
        # Most cells are as sure as they may be: a line that is not written need not go back to memory.
        is_new = builder.bitcast(builder.icmp_signed("!=", new, old), INT64)
        with builder.if_then(builder.icmp_unsigned("!=", is_new, ir.Constant(INT64, 0))):
            store_at(builder, new, place)
        is_other = [
            builder.xor(builder.icmp_signed(sign, old, NO_BYTES), builder.icmp_signed(sign, new, NO_BYTES))
            for sign in "<>"
        ]
        return builder.bitcast(builder.or_(*is_other), INT64)

    steps = (types.int64,) * 4
    return types.uint64(types.int64, types.uint64, types.uint64, *steps), generate


def _fetch(typing_context: Any, address: Any) -> Any:  # noqa: ANN401
    """Begin to load a line of memory."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        insert: Any = cgutils.get_or_insert_function
        pointer, number = builder.inttoptr(arguments[0], ir.IntType(8).as_pointer()), ir.IntType(32)
        function = insert(
            builder.module,
            ir.FunctionType(ir.VoidType(), [pointer.type, number, number, number]),
            "llvm.prefetch.p0",
        )
        for_writing, near, data = (ir.Constant(number, value) for value in (1, 3, 1))
        builder.call(function, [pointer, for_writing, near, data])

    return types.void(types.int64), generate


def _sum_blocks(typing_context: Any, first: Any, second: Any, result: Any) -> Any:  # noqa: ANN401
    """Write the sum of two blocks, clipped to [-127, 127], where it has changed.

    The sum is written only where it differs from the present values.
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        one, other, old = (load_at(builder, address, BYTES) for address in arguments)
        total = call_vectors(
            builder, "smax", call_vectors(builder, "sadd.sat", one, other), ir.Constant(BYTES, [-127] * BLOCK)
        )
        is_new = builder.bitcast(builder.icmp_signed("!=", total, old), INT64)
        with builder.if_then(builder.icmp_unsigned("!=", is_new, ir.Constant(INT64, 0))):
            store_at(builder, total, arguments[2])

    return types.void(*(types.int64,) * 3), generate


def _greatest_of_groups(
    typing_context: Any,  # noqa: ANN401
    rows: Any,  # noqa: ANN401
    stride: Any,  # noqa: ANN401
    count: Any,  # noqa: ANN401
    least: Any,  # noqa: ANN401
    halvings: Any,  # noqa: ANN401
    result: Any,  # noqa: ANN401
) -> Any:  # noqa: ANN401
    """Write the maximum of the blocks of some rows and of groups of neighbours.

    Each halving takes the maximum of two neighbours.
    """

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        rows_at, stride, count, least, halvings, result_at = arguments
        none, one, nothing = ir.Constant(INT64, 0), ir.Constant(INT64, 1), ir.Constant(BYTES, ir.Undefined)
        half = BLOCK // 2
        lanes = [
            ir.Constant(ir.VectorType(ir.IntType(32), BLOCK), [2 * (k % half) + place for k in range(BLOCK)])
            for place in (0, 1)
        ]
        greatest = alloca(builder, splat(builder, least, BYTES))
        with cgutils.for_range_slice(builder, none, count, one, intp=INT64) as (k, _):
            row = load_at(builder, builder.add(rows_at, builder.mul(k, stride)), BYTES)
            builder.store(call_vectors(builder, "smax", builder.load(greatest), row), greatest)
        with cgutils.for_range_slice(builder, none, halvings, one, intp=INT64):
            all_lanes = builder.load(greatest)
            builder.store(
                call_vectors(
                    builder, "smax", *(builder.shuffle_vector(all_lanes, nothing, places) for places in lanes)
                ),
                greatest,
            )
        store_at(builder, builder.load(greatest), result_at)

    return types.void(*(types.int64,) * 6), generate


def _levels_of(cells: int) -> Any:  # noqa: ANN401
    """Return a function that writes so many log-odds as levels.

    Levels: 0 where positive, 127 at zero, 255 where negative.
    """

    def levels_of(typing_context: Any, log_odds: Any, levels: Any) -> Any:  # noqa: ANN401
        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
            kind = ir.VectorType(ir.IntType(8), cells)
            zero, occupied, unknown, free = (ir.Constant(kind, [level] * cells) for level in (0, *LEVELS))
            old = load_at(builder, arguments[0], kind)
            known = builder.select(builder.icmp_signed(">", old, zero), occupied, unknown)
            store_at(builder, builder.select(builder.icmp_signed("<", old, zero), free, known), arguments[1])

        return types.void(types.int64, types.int64), generate

    return levels_of


_update = machine_code(_update_block, plain_forms.update_block)
_fetch_line = machine_code(_fetch, plain_forms.fetch_block)
_sum = machine_code(_sum_blocks, plain_forms.sum_blocks)
_greatest = machine_code(_greatest_of_groups, plain_forms.write_greatest)
_block_of_levels = machine_code(_levels_of(BLOCK), plain_forms.write_block_of_levels)
_half_block_of_levels = machine_code(_levels_of(HALF_BLOCK), plain_forms.write_levels)


@kernel(inline=True)
def update_block(
    address: int, seen: np.uint64, hits: np.uint64, hit: int, miss: int, minimum: int, maximum: int
) -> np.uint64:
    """Lower the seen cells of a block and raise the hit ones.

    A cell that is both is raised.

    Parameters
    ----------
    address : int
        Where the block's 64 int8 lie.
    seen, hits : uint64
        Which cells, bit 0 the first one.
    hit, miss : int
        What is added where hit and taken where seen, positive.
    minimum, maximum : int
        Bounds of lowered and of raised cells.

    Returns
    -------
    uint64
        Which cells have changed their sign: another level than before.
    """
    changed: np.uint64 = _update(address, seen, hits, hit, miss, minimum, maximum)
    return changed


@kernel(inline=True)
def fetch_block(address: int) -> None:
    """Begin to load a block of bytes that will be written soon; it need not be there."""
    _fetch_line(address)


@kernel(inline=True)
def sum_blocks(first: int, second: int, result: int) -> None:
    """Write the sum of two int8 blocks, clipped to [-127, 127], into a third.

    The third may be one of the two. Nothing is written where the sum is there already.
    """
    _sum(first, second, result)


@kernel(inline=True)
def write_greatest(rows: int, stride: int, count: int, least: int, halvings: int, result: int) -> None:
    """Write the greatest int8 of groups of cells in a word of 64, and of ``least``.

    Parameters
    ----------
    rows, stride, count : int
        Where the first block lies, how many bytes on the next one, and how many there are.
    least : int
        What the result is at least.
    halvings : int
        A group has 2 ** halvings columns, and all rows.
    result : int
        Where 64 bytes are written, of which the first 64 / 2 ** halvings are the groups'.
    """
    _greatest(rows, stride, count, least, halvings, result)


@kernel(inline=True)
def write_levels(log_odds: int, levels: int) -> None:
    """Write 32 int8 cells as uint8 levels.

    Levels: 0 occupied where positive, 127 unknown at zero, 255 free where negative.
    """
    _half_block_of_levels(log_odds, levels)


@kernel(inline=True)
def write_block_of_levels(log_odds: int, levels: int) -> None:
    """Write 64 cells as ``write_levels`` does."""
    _block_of_levels(log_odds, levels)
