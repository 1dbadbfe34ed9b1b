"""Blocks of 64 cells at once: what kernels do to log-odds and distances by the word.

A word of bits says which cells of a block are meant. LLVM turns the operations on vectors of 64 numbers into what the machine
has, whatever the width of its registers; numba cannot write them as loops, since it keeps no bit per lane and unrolls loops of a
known length before it could run them on vectors. Blocks are given by their address; the caller sees to it that all 64 cells
lie within the array.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from lidarium.mapping.kernels import kernel

BLOCK = 64
"""Cells of a block."""

HALF_BLOCK = 32
"""Cells of which levels are told at a time where there are fewer than a block."""

_INT16, _INT64 = ir.IntType(16), ir.IntType(64)
_BYTES, _SHORTS = ir.VectorType(ir.IntType(8), BLOCK), ir.VectorType(_INT16, BLOCK)
_MASK = ir.VectorType(ir.IntType(1), BLOCK)
_NO_BYTES, _NO_SHORTS = ir.Constant(_BYTES, [0] * BLOCK), ir.Constant(_SHORTS, [0] * BLOCK)


def _splat(builder: Any, value: Any, kind: Any) -> Any:  # noqa: ANN401
    """Repeat an integer in all lanes of a kind of vector."""
    nothing = ir.Constant(kind, ir.Undefined)
    lane = value if value.type == kind.element else builder.trunc(value, kind.element)
    first = builder.insert_element(nothing, lane, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(ir.IntType(32), BLOCK), [0] * BLOCK))


def _call(builder: Any, name: str, first: Any, second: Any) -> Any:  # noqa: ANN401
    """Call one of LLVM's own functions of two vectors."""
    kind = first.type
    insert: Any = cgutils.get_or_insert_function
    function = insert(builder.module, ir.FunctionType(kind, [kind, kind]), f"llvm.{name}.v{BLOCK}i{kind.element.width}")
    return builder.call(function, [first, second])


_alloca: Any = cgutils.alloca_once_value


def _load(builder: Any, address: Any, kind: Any) -> Any:  # noqa: ANN401
    return builder.load(builder.inttoptr(address, kind.as_pointer()), align=1)


def _store(builder: Any, value: Any, address: Any) -> None:  # noqa: ANN401
    builder.store(value, builder.inttoptr(address, value.type.as_pointer()), align=1)


def _update_block(typing_context: Any, address: Any, seen: Any, hits: Any, hit: Any, miss: Any, minimum: Any, maximum: Any) -> Any:  # noqa: ANN401
    """Lower the seen cells of a block and raise the hit ones."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        place, seen_bits, hit_bits, hit_step, miss_step, least, greatest = arguments
        old = _load(builder, place, _BYTES)
        lowered = _call(builder, "ssub.sat", old, _splat(builder, miss_step, _BYTES))
        lowered = _call(builder, "smax", lowered, _splat(builder, least, _BYTES))
        raised = _call(builder, "sadd.sat", old, _splat(builder, hit_step, _BYTES))
        raised = _call(builder, "smin", raised, _splat(builder, greatest, _BYTES))
        missed = builder.select(builder.bitcast(seen_bits, _MASK), lowered, old)
        new = builder.select(builder.bitcast(hit_bits, _MASK), raised, missed)
        # Most cells are as sure as they may be: a line that is not written need not go back to memory.
        is_new = builder.bitcast(builder.icmp_signed("!=", new, old), _INT64)
        with builder.if_then(builder.icmp_unsigned("!=", is_new, ir.Constant(_INT64, 0))):
            _store(builder, new, place)
        is_other = [builder.xor(builder.icmp_signed(sign, old, _NO_BYTES), builder.icmp_signed(sign, new, _NO_BYTES)) for sign in "<>"]
        return builder.bitcast(builder.or_(*is_other), _INT64)

    steps = (types.int64,) * 4
    return types.uint64(types.int64, types.uint64, types.uint64, *steps), generate


def _fetch(typing_context: Any, address: Any) -> Any:  # noqa: ANN401
    """Begin to load a line of memory."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        insert: Any = cgutils.get_or_insert_function
        pointer, number = builder.inttoptr(arguments[0], ir.IntType(8).as_pointer()), ir.IntType(32)
        function = insert(builder.module, ir.FunctionType(ir.VoidType(), [pointer.type, number, number, number]), "llvm.prefetch.p0")
        for_writing, near, data = (ir.Constant(number, value) for value in (1, 3, 1))
        builder.call(function, [pointer, for_writing, near, data])

    return types.void(types.int64), generate


def _sum_blocks(typing_context: Any, first: Any, second: Any, result: Any) -> Any:  # noqa: ANN401
    """Write the sum of two blocks, cut to [-127, 127], where it is another than what is there."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        one, other, old = (_load(builder, address, _BYTES) for address in arguments)
        total = _call(builder, "smax", _call(builder, "sadd.sat", one, other), ir.Constant(_BYTES, [-127] * BLOCK))
        is_new = builder.bitcast(builder.icmp_signed("!=", total, old), _INT64)
        with builder.if_then(builder.icmp_unsigned("!=", is_new, ir.Constant(_INT64, 0))):
            _store(builder, total, arguments[2])

    return types.void(*(types.int64,) * 3), generate


def _greatest_of_groups(typing_context: Any, rows: Any, stride: Any, count: Any, least: Any, halvings: Any, result: Any) -> Any:  # noqa: ANN401
    """Write the greatest of the blocks of some rows, and of neighbours in it, halved and halved again."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        rows_at, stride, count, least, halvings, result_at = arguments
        none, one, nothing = ir.Constant(_INT64, 0), ir.Constant(_INT64, 1), ir.Constant(_BYTES, ir.Undefined)
        half = BLOCK // 2
        lanes = [ir.Constant(ir.VectorType(ir.IntType(32), BLOCK), [2 * (k % half) + place for k in range(BLOCK)]) for place in (0, 1)]
        greatest = _alloca(builder, _splat(builder, least, _BYTES))
        with cgutils.for_range_slice(builder, none, count, one, intp=_INT64) as (k, _):
            row = _load(builder, builder.add(rows_at, builder.mul(k, stride)), _BYTES)
            builder.store(_call(builder, "smax", builder.load(greatest), row), greatest)
        with cgutils.for_range_slice(builder, none, halvings, one, intp=_INT64):
            all_lanes = builder.load(greatest)
            builder.store(_call(builder, "smax", *(builder.shuffle_vector(all_lanes, nothing, places) for places in lanes)), greatest)
        _store(builder, builder.load(greatest), result_at)

    return types.void(*(types.int64,) * 6), generate


def _levels_of(cells: int) -> Any:  # noqa: ANN401
    """Return what writes so many log-odds as levels: 0 where positive, 127 at zero, 255 where negative."""

    def levels_of(typing_context: Any, log_odds: Any, levels: Any) -> Any:  # noqa: ANN401
        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
            kind = ir.VectorType(ir.IntType(8), cells)
            zero, unknown, free = (ir.Constant(kind, [level] * cells) for level in (0, 127, 255))
            old = _load(builder, arguments[0], kind)
            known = builder.select(builder.icmp_signed(">", old, zero), zero, unknown)
            _store(builder, builder.select(builder.icmp_signed("<", old, zero), free, known), arguments[1])

        return types.void(types.int64, types.int64), generate

    return intrinsic(levels_of)


def _positive_differs(typing_context: Any, log_odds: Any, numbers: Any, number: Any) -> Any:  # noqa: ANN401
    """Tell in which cells it does not go together that the log-odds are positive and the number is the given one."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        beliefs_at, numbers_at, value = arguments
        is_positive = builder.icmp_signed(">", _load(builder, beliefs_at, _BYTES), _NO_BYTES)
        is_number = builder.icmp_signed("==", _load(builder, numbers_at, _SHORTS), _splat(builder, value, _SHORTS))
        return builder.bitcast(builder.xor(is_positive, is_number), _INT64)

    return types.uint64(*(types.int64,) * 3), generate


def _count_rows(typing_context: Any, log_odds: Any, stride: Any, rows: Any, steps: Any, largest: Any, fewest: Any, width: Any) -> Any:  # noqa: ANN401
    """Count the steps in each lane, row by row, up to the largest number, or begin anew at 0 where the log-odds are positive."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        beliefs_at, stride, rows, steps_at, most, fewest_at, width = arguments
        none, one = ir.Constant(_INT64, 0), ir.Constant(_INT64, 1)
        largest, counted = _splat(builder, most, _SHORTS), _alloca(builder, _load(builder, steps_at, _SHORTS))
        with cgutils.for_range_slice(builder, none, rows, one, intp=_INT64) as (k, _):
            beliefs = _load(builder, builder.add(beliefs_at, builder.mul(k, stride)), _BYTES)
            more = _call(builder, "umin", builder.add(builder.load(counted), ir.Constant(_SHORTS, [1] * BLOCK)), largest)
            now = builder.select(builder.icmp_signed(">", beliefs, _NO_BYTES), _NO_SHORTS, more)
            builder.store(now, counted)
            target = builder.add(fewest_at, builder.mul(k, width))
            _store(builder, _call(builder, "umin", now, _load(builder, target, _SHORTS)), target)
        _store(builder, builder.load(counted), steps_at)

    return types.void(*(types.int64,) * 7), generate


def _squares(typing_context: Any, steps: Any, far: Any, cap: Any, result: Any) -> Any:  # noqa: ANN401
    """Write the squared distances in half cells after some steps; tell the fewest."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        steps_at, far, cap, result_at = arguments
        steps = _load(builder, steps_at, _SHORTS)
        half_cells = _call(builder, "usub.sat", builder.add(steps, steps), ir.Constant(_SHORTS, [1] * BLOCK))
        caps, is_near = _splat(builder, cap, _SHORTS), builder.icmp_unsigned("<", steps, _splat(builder, far, _SHORTS))
        squares = _call(builder, "umin", builder.mul(half_cells, half_cells), caps)
        _store(builder, builder.select(is_near, squares, caps), result_at)
        insert: Any = cgutils.get_or_insert_function
        function = insert(builder.module, ir.FunctionType(_INT16, [_SHORTS]), f"llvm.vector.reduce.umin.v{BLOCK}i16")
        return builder.zext(builder.call(function, [steps]), _INT64)

    return types.int64(*(types.int64,) * 4), generate


def _least_sums(typing_context: Any, numbers: Any, costs: Any, low: Any, high: Any, cap: Any, result: Any) -> Any:  # noqa: ANN401
    """Write cap - min(cap, numbers[j + k] + costs[k]) for the lanes j, the least over k from low to high."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        numbers_at, costs_at, first, last, most, result_at = arguments
        caps = _splat(builder, most, _SHORTS)
        least = _alloca(builder, caps)
        with cgutils.for_range_slice(builder, first, last, ir.Constant(_INT64, 1), intp=_INT64) as (k, _):
            offset = builder.shl(k, ir.Constant(_INT64, 1))
            number = _load(builder, builder.add(numbers_at, offset), _SHORTS)
            cost = _splat(builder, _load(builder, builder.add(costs_at, offset), _INT16), _SHORTS)
            builder.store(_call(builder, "umin", builder.load(least), builder.add(number, cost)), least)
        _store(builder, builder.sub(caps, builder.load(least)), result_at)

    return types.void(*(types.int64,) * 6), generate


def _same_block(typing_context: Any, block: Any, other: Any) -> Any:  # noqa: ANN401
    """Tell which numbers of two blocks are the same, and not 0."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        one, two = (_load(builder, address, _SHORTS) for address in arguments)
        is_same = builder.and_(builder.icmp_signed("==", one, two), builder.icmp_signed("!=", two, _NO_SHORTS))
        return builder.bitcast(is_same, _INT64)

    return types.uint64(types.int64, types.int64), generate


def _negative_block(typing_context: Any, block: Any) -> Any:  # noqa: ANN401
    """Tell which log-odds of a block are less than 0."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        return builder.bitcast(builder.icmp_signed("<", _load(builder, arguments[0], _BYTES), _NO_BYTES), _INT64)

    return types.uint64(types.int64), generate


def _positive_block(typing_context: Any, block: Any) -> Any:  # noqa: ANN401
    """Tell which log-odds of a block are more than 0."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        return builder.bitcast(builder.icmp_signed(">", _load(builder, arguments[0], _BYTES), _NO_BYTES), _INT64)

    return types.uint64(types.int64), generate


def _sign_bits(typing_context: Any, sums: Any) -> Any:  # noqa: ANN401
    """Tell which cells of a block of sums are below and which are above 0."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        total = _load(builder, arguments[0], _SHORTS)
        below, above = (builder.bitcast(builder.icmp_signed(order, total, _NO_SHORTS), _INT64) for order in "<>")
        return context.make_tuple(builder, signature.return_type, (below, above))

    pair: Any = types.UniTuple
    return pair(types.uint64, 2)(types.int64), generate


def _raise_block(typing_context: Any, block: Any, other: Any) -> Any:  # noqa: ANN401
    """Raise the numbers of a block to those of another where these are greater."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        _store(builder, _call(builder, "umax", *(_load(builder, address, _SHORTS) for address in arguments)), arguments[0])

    return types.void(types.int64, types.int64), generate


_update: Any = intrinsic(_update_block)
_fetch_line: Any = intrinsic(_fetch)
_sum: Any = intrinsic(_sum_blocks)
_greatest: Any = intrinsic(_greatest_of_groups)
_block_of_levels, _half_block_of_levels = _levels_of(BLOCK), _levels_of(HALF_BLOCK)
_differs: Any = intrinsic(_positive_differs)
_count: Any = intrinsic(_count_rows)
_square: Any = intrinsic(_squares)
_least: Any = intrinsic(_least_sums)
_raise: Any = intrinsic(_raise_block)
_signs: Any = intrinsic(_sign_bits)
_same: Any = intrinsic(_same_block)
_negative: Any = intrinsic(_negative_block)
_positive: Any = intrinsic(_positive_block)


@kernel(inline=True)
def update_block(address: int, seen: np.uint64, hits: np.uint64, hit: int, miss: int, minimum: int, maximum: int) -> np.uint64:
    """Lower the seen cells of a block and raise the hit ones; a cell that is both is raised.

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
    """Write the sum of two blocks of int8, cut to [-127, 127], into a third, which may be one of them; not where it is there already."""
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
    """Write 32 cells of int8 as levels of uint8: 0 occupied where positive, 127 unknown at zero, 255 free where negative."""
    _half_block_of_levels(log_odds, levels)


@kernel(inline=True)
def write_block_of_levels(log_odds: int, levels: int) -> None:
    """Write 64 cells as ``write_levels`` does."""
    _block_of_levels(log_odds, levels)


@kernel(inline=True)
def cells_that_differ(log_odds: int, numbers: int, number: int) -> np.uint64:
    """Tell in which cells of two blocks, int8 and uint16, only one is true: the log-odds are positive, the other is ``number``."""
    cells: np.uint64 = _differs(log_odds, numbers, number)
    return cells


@kernel(inline=True)
def count_rows(log_odds: int, stride: int, rows: int, steps: int, largest: int, fewest: int, width: int) -> None:
    """Count, row by row, the rows since the last occupied cell of each of 64 columns, and keep the fewest that each place has had.

    Parameters
    ----------
    log_odds, stride, rows : int
        Where the first row's block of int8 lies, how many bytes on the next one, less than 0 for the way back, and how many there are.
    steps : int
        A block of uint16 with the steps before the first row, and after the last one in the end: one more in each row up to
        ``largest``, 0 where log-odds are positive.
    fewest, width : int
        Where the block of uint16 of the first row lies that is lowered to the steps, and how many bytes on the next one.
    """
    _count(log_odds, stride, rows, steps, largest, fewest, width)


@kernel(inline=True)
def write_squares(steps: int, far: int, cap: int, result: int) -> int:
    """Write how far it is, squared and in half cells, after the steps of cells in a block of uint16, and return the fewest steps.

    From ``far`` steps on it is ``cap``, which it never exceeds; (2 ``far`` - 1) ^ 2 must fit into 16 bits.
    """
    fewest: int = _square(steps, far, cap, result)
    return fewest


@kernel(inline=True)
def write_least_sums(numbers: int, costs: int, low: int, high: int, cap: int, result: int) -> None:
    """Write what is left of ``cap`` after the least of ``numbers[j + k] + costs[k]`` over k from ``low`` to ``high``, for 64 cells j.

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


@kernel(inline=True)
def sign_bits(address: int) -> tuple[np.uint64, np.uint64]:
    """Return which of the 64 int16 at an address are below 0, and which are above, bit 0 the first one."""
    return _signs(address)  # type: ignore[no-any-return]


@kernel(inline=True)
def negative_cells(address: int) -> np.uint64:
    """Return which of the 64 int8 at an address are less than 0, bit 0 the first one."""
    return _negative(address)  # type: ignore[no-any-return]


@kernel(inline=True)
def positive_cells(address: int) -> np.uint64:
    """Return which of the 64 int8 at an address are more than 0, bit 0 the first one."""
    return _positive(address)  # type: ignore[no-any-return]
