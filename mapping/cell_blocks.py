"""Blocks of 64 cells at once: log-odds lowered and raised under masks of bits, and told apart by their signs.

A word of bits says which cells of a block are meant. LLVM turns the operations on vectors of 64 bytes into what the machine
has, whatever the width of its registers; numba cannot write them as loops, since it keeps no bit per lane.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from lidarium.mapping.kernels import kernel

_BYTE = ir.IntType(8)
_BLOCK = ir.VectorType(_BYTE, 64)
_MASK = ir.VectorType(ir.IntType(1), 64)


def _splat(builder: Any, value: Any) -> Any:  # noqa: ANN401
    """Repeat an integer in all 64 lanes."""
    lane = builder.trunc(value, _BYTE)
    first = builder.insert_element(ir.Constant(_BLOCK, ir.Undefined), lane, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, ir.Constant(_BLOCK, ir.Undefined), ir.Constant(ir.VectorType(ir.IntType(32), 64), [0] * 64))


def _call(builder: Any, name: str, first: Any, second: Any) -> Any:  # noqa: ANN401
    """Call one of LLVM's own functions of two blocks."""
    insert: Any = cgutils.get_or_insert_function
    function = insert(builder.module, ir.FunctionType(_BLOCK, [_BLOCK, _BLOCK]), f"llvm.{name}.v64i8")
    return builder.call(function, [first, second])


def _update_block(typing_context: Any, address: Any, seen: Any, hits: Any, hit: Any, miss: Any, minimum: Any, maximum: Any) -> Any:  # noqa: ANN401
    """Lower the seen cells of a block and raise the hit ones."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        place, seen_bits, hit_bits, hit_step, miss_step, least, greatest = arguments
        pointer = builder.inttoptr(place, _BLOCK.as_pointer())
        old = builder.load(pointer, align=1)
        lowered = _call(builder, "smax", _call(builder, "ssub.sat", old, _splat(builder, miss_step)), _splat(builder, least))
        raised = _call(builder, "smin", _call(builder, "sadd.sat", old, _splat(builder, hit_step)), _splat(builder, greatest))
        new = builder.select(builder.bitcast(seen_bits, _MASK), lowered, old)
        builder.store(builder.select(builder.bitcast(hit_bits, _MASK), raised, new), pointer, align=1)

    steps = (types.int64,) * 4
    return types.void(types.int64, types.uint64, types.uint64, *steps), generate


_update: Any = intrinsic(_update_block)


@kernel(inline=True)
def update_block(address: int, seen: np.uint64, hits: np.uint64, hit: int, miss: int, minimum: int, maximum: int) -> None:
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
    """
    _update(address, seen, hits, hit, miss, minimum, maximum)


def _compare_block(predicate: str) -> Any:  # noqa: ANN401
    """Return an intrinsic that says which cells of a block are less (``<``) or more (``>``) than 0."""

    def compare(typing_context: Any, address: Any) -> Any:  # noqa: ANN401
        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
            block = builder.load(builder.inttoptr(arguments[0], _BLOCK.as_pointer()), align=1)
            zero = ir.Constant(_BLOCK, [0] * 64)
            return builder.bitcast(builder.icmp_signed(predicate, block, zero), ir.IntType(64))

        return types.uint64(types.int64), generate

    return intrinsic(compare)


_negative: Any = _compare_block("<")
_positive: Any = _compare_block(">")


@kernel(inline=True)
def negative_cells(address: int) -> np.uint64:
    """Return which of the 64 int8 at an address are less than 0, bit 0 the first one."""
    return _negative(address)  # type: ignore[no-any-return]


@kernel(inline=True)
def positive_cells(address: int) -> np.uint64:
    """Return which of the 64 int8 at an address are more than 0, bit 0 the first one."""
    return _positive(address)  # type: ignore[no-any-return]
