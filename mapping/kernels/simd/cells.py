"""Operations on blocks of 64 cells of log-odds (int8) at addresses.

The bits of a word choose cells of a block. LLVM turns vectors of 64 numbers into instructions of the
processor, of any register width. The caller ensures that all 64 cells lie within the array.
"""

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.llvm import (
    BLOCK,
    INT,
    LONG,
    Builder,
    Value,
    bits_of_lanes,
    call,
    constant,
    if_any,
    lanewise,
    llvm_overload,
    load_at,
    numba_types,
    pack_array,
    pointer_at,
    splat,
    stack_slot,
    store_at,
    vector,
)
from lidarium.mapping.kernels.simd.words import bits_of, cells_of
from lidarium.mapping.kernels.views import vector_at

LEVELS = (0, 127, 255)
"""An occupied, an unknown and a free cell in maps of levels (uint8)."""

HALF_BLOCK = 32
"""Cells of which levels are written at a time if there are fewer than a block."""

BYTES, SHORTS = vector(ir.IntType(8), BLOCK), vector(ir.IntType(16), BLOCK)
NO_BYTES, NO_SHORTS = constant(BYTES, 0), constant(SHORTS, 0)
_MASK = vector(ir.IntType(1), BLOCK)


def update_block(
    address: int, seen: np.uint64, hits: np.uint64, hit: int, miss: int, minimum: int, maximum: int
) -> np.uint64:
    """Lower the seen cells of a block by ``miss`` down to ``minimum``, raise the hit ones by ``hit``.

    A cell that is both is raised, up to ``maximum``. Returns the cells that have changed their sign.
    """
    block = vector_at(address, BLOCK, np.int8)
    old = np.array(block)
    lowered = np.maximum(np.clip(old.astype(int) - miss, -128, 127), minimum)
    raised = np.minimum(np.clip(old.astype(int) + hit, -128, 127), maximum)
    block[:] = np.where(cells_of(hits), raised, np.where(cells_of(seen), lowered, old))
    return bits_of(np.sign(block) != np.sign(old))


@llvm_overload(update_block, types.uint64, types.int64, types.uint64, types.uint64, *(types.int64,) * 4)
def _(
    builder: Builder,
    address: Value,
    seen: Value,
    hits: Value,
    hit: Value,
    miss: Value,
    minimum: Value,
    maximum: Value,
) -> Value:
    old = load_at(builder, address, BYTES)
    lowered = lanewise(builder, "ssub.sat", old, splat(builder, miss, BYTES))
    lowered = lanewise(builder, "smax", lowered, splat(builder, minimum, BYTES))
    raised = lanewise(builder, "sadd.sat", old, splat(builder, hit, BYTES))
    raised = lanewise(builder, "smin", raised, splat(builder, maximum, BYTES))
    missed = builder.select(builder.bitcast(seen, _MASK), lowered, old)
    new = builder.select(builder.bitcast(hits, _MASK), raised, missed)
    # Most cells are at a bound already: a cache line that is not written need not go back to memory.
    with if_any(builder, builder.icmp_signed("!=", new, old)):
        store_at(builder, new, address)
    is_other = [
        builder.xor(builder.icmp_signed(sign, old, NO_BYTES), builder.icmp_signed(sign, new, NO_BYTES)) for sign in "<>"
    ]
    return bits_of_lanes(builder, builder.or_(*is_other))


def prefetch(address: int) -> None:
    """Begin to load a cache line that will be written soon; it need not exist."""


@llvm_overload(prefetch, types.void, types.int64)
def _(builder: Builder, address: Value) -> Value:
    for_writing, near, data = (ir.Constant(INT, value) for value in (1, 3, 1))
    pointer = pointer_at(builder, address, ir.IntType(8))
    call(builder, "llvm.prefetch.p0", ir.VoidType(), pointer, for_writing, near, data)


def sum_blocks(grids: int, stride: int, count: int, place: int, result: int) -> None:
    """Write the sum of the blocks at a place in up to 255 grids, clipped to [-127, 127].

    The addresses of the grids lie from ``grids`` on, ``stride`` bytes apart.
    """
    starts = [int(vector_at(grids + k * stride, 1, np.int64)[0]) for k in range(count)]
    total = sum(vector_at(start + place, BLOCK, np.int8).astype(int) for start in starts)
    vector_at(result, BLOCK, np.int8)[:] = np.clip(total, -127, 127)


@llvm_overload(sum_blocks, types.void, *(types.int64,) * 5)
def _(builder: Builder, grids: Value, stride: Value, count: Value, place: Value, result: Value) -> Value:
    none, one = ir.Constant(LONG, 0), ir.Constant(LONG, 1)
    sums = stack_slot(builder, NO_SHORTS)
    with cgutils.for_range_slice(builder, none, count, one, intp=LONG) as (k, _):
        start = load_at(builder, builder.add(grids, builder.mul(k, stride)), LONG)
        block = builder.sext(load_at(builder, builder.add(start, place), BYTES), SHORTS)
        # Clipped once, at the end: the order of the grids does not matter.
        builder.store(builder.add(builder.load(sums), block), sums)
    clipped = lanewise(builder, "smin", builder.load(sums), constant(SHORTS, 127))
    total = builder.trunc(lanewise(builder, "smax", clipped, constant(SHORTS, -127)), BYTES)
    with if_any(builder, builder.icmp_signed("!=", total, load_at(builder, result, BYTES))):
        store_at(builder, total, result)


def max_of_groups(rows: int, stride: int, count: int, minimum: int, halvings: int, result: int) -> None:
    """Write the maxima of groups of ``2 ** halvings`` columns of ``count`` blocks, and of ``minimum``.

    Blocks are ``stride`` bytes apart. 64 bytes are written, of which the first 64 / 2 ** halvings are the maxima.
    """
    blocks = [vector_at(rows + k * stride, BLOCK, np.int8) for k in range(count)]
    maxima = np.max([np.full(BLOCK, minimum), *blocks], axis=0).reshape(-1, 2**halvings).max(axis=1)
    vector_at(result, len(maxima), np.int8)[:] = maxima


@llvm_overload(max_of_groups, types.void, *(types.int64,) * 6)
def _(
    builder: Builder, rows: Value, stride: Value, count: Value, minimum: Value, halvings: Value, result: Value
) -> Value:
    none, one, undefined = ir.Constant(LONG, 0), ir.Constant(LONG, 1), ir.Constant(BYTES, ir.Undefined)
    half, indices = BLOCK // 2, vector(INT, BLOCK)
    sides = [constant(indices, *(2 * (k % half) + side for k in range(BLOCK))) for side in (0, 1)]
    maxima = stack_slot(builder, splat(builder, minimum, BYTES))
    with cgutils.for_range_slice(builder, none, count, one, intp=LONG) as (k, _):
        row = load_at(builder, builder.add(rows, builder.mul(k, stride)), BYTES)
        builder.store(lanewise(builder, "smax", builder.load(maxima), row), maxima)
    with cgutils.for_range_slice(builder, none, halvings, one, intp=LONG):
        lanes = builder.load(maxima)
        neighbours = (builder.shuffle_vector(lanes, undefined, side) for side in sides)
        builder.store(lanewise(builder, "smax", *neighbours), maxima)
    store_at(builder, builder.load(maxima), result)


@kernel(forceinline=True, nrt=False)
def block_of_levels(log_odds: int, levels: int) -> None:
    """Write 64 cells as levels: occupied if positive, unknown at zero, free if negative.

    Numba's vectors are as fast as text would be; of 32 cells numba makes none.
    """
    occupied, unknown, free = LEVELS
    cells, written = vector_at(log_odds, BLOCK, np.int8), vector_at(levels, BLOCK, np.uint8)
    for k in range(BLOCK):
        written[k] = occupied if cells[k] > 0 else free if cells[k] < 0 else unknown


def half_block_of_levels(log_odds: int, levels: int) -> None:
    """Write 32 cells as ``block_of_levels`` does."""
    signs = np.sign(vector_at(log_odds, HALF_BLOCK, np.int8))
    vector_at(levels, HALF_BLOCK, np.uint8)[:] = np.array(LEVELS, np.uint8)[1 - signs]


def levels_of(builder: Builder, log_odds: Value) -> Value:
    """Return a vector of log-odds as levels."""
    zero, occupied, unknown, free = (constant(log_odds.type, level) for level in (0, *LEVELS))
    known = builder.select(builder.icmp_signed(">", log_odds, zero), occupied, unknown)
    return builder.select(builder.icmp_signed("<", log_odds, zero), free, known)


@llvm_overload(half_block_of_levels, types.void, types.int64, types.int64)
def _(builder: Builder, log_odds: Value, levels: Value) -> Value:
    half = vector(ir.IntType(8), HALF_BLOCK)
    store_at(builder, levels_of(builder, load_at(builder, log_odds, half)), levels)


def sign_bits(address: int) -> tuple[np.uint64, np.uint64]:
    """Return which of 64 int16 at an address are below 0, and which above."""
    sums = vector_at(address, BLOCK, np.int16)
    return bits_of(sums < 0), bits_of(sums > 0)


@llvm_overload(sign_bits, numba_types.UniTuple(types.uint64, 2), types.int64)
def _(builder: Builder, address: Value) -> Value:
    sums = load_at(builder, address, SHORTS)
    words = [bits_of_lanes(builder, builder.icmp_signed(order, sums, NO_SHORTS)) for order in "<>"]
    return pack_array(builder, words)


def negative_cells(address: int) -> np.uint64:
    """Return which cells of a block are less than 0."""
    return bits_of(vector_at(address, BLOCK, np.int8) < 0)


@llvm_overload(negative_cells, types.uint64, types.int64)
def _(builder: Builder, address: Value) -> Value:
    return bits_of_lanes(builder, builder.icmp_signed("<", load_at(builder, address, BYTES), NO_BYTES))


def positive_cells(address: int) -> np.uint64:
    """Return which cells of a block are more than 0."""
    return bits_of(vector_at(address, BLOCK, np.int8) > 0)


@llvm_overload(positive_cells, types.uint64, types.int64)
def _(builder: Builder, address: Value) -> Value:
    return bits_of_lanes(builder, builder.icmp_signed(">", load_at(builder, address, BYTES), NO_BYTES))
