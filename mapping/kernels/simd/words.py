"""Operations on words of 64 bits, one bit for each cell.

They take many steps in Python and few instructions of the processor.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.llvm import (
    LONG,
    Builder,
    Value,
    bits_of_lanes,
    call,
    constant,
    has_feature,
    llvm_overload,
    load_at,
    splat,
    vector,
)
from lidarium.mapping.kernels.views import vector_at

CAN_MULTIPLY_WITHOUT_CARRY = has_feature("pclmul")
"""Whether the processor multiplies without carrying."""


def bits_of(cells: NDArray[Any]) -> np.uint64:
    """Return a word with a bit for each cell that is true, bit 0 the first; for definitions."""
    return np.uint64(sum(1 << int(index) for index in np.flatnonzero(cells)))


def cells_of(word: int | np.uint64, count: int = 64) -> NDArray[np.bool_]:
    """Return which of the first bits of a word are set, (count,); for definitions."""
    return np.array([int(word) >> index & 1 for index in range(count)], bool)


def first_bit(word: np.uint64) -> int:
    """Return the index of the first bit that is set; one must be."""
    return int(np.flatnonzero(cells_of(word))[0])


@llvm_overload(first_bit, types.int64, types.uint64)
def _(builder: Builder, word: Value) -> Value:
    return builder.cttz(word, ir.Constant(ir.IntType(1), 1))


def free_cells(levels: int) -> np.uint64:
    """Return which of the 64 int8 at an address are below 0, bit 0 the first."""
    return bits_of(np.array(vector_at(levels, 64, np.int8)) < 0)


@llvm_overload(free_cells, types.uint64, types.int64)
def _(builder: Builder, levels: Value) -> Value:
    kind = vector(ir.IntType(8), 64)
    return bits_of_lanes(builder, builder.icmp_signed("<", load_at(builder, levels, kind), constant(kind, 0)))


def near_cells(closeness: int, limit: int) -> np.uint64:
    """Return which of the 64 uint16 at an address are at most a limit, bit 0 the first; none if it is negative."""
    return bits_of(np.array(vector_at(closeness, 64, np.uint16)) <= limit)


@llvm_overload(near_cells, types.uint64, types.int64, types.int64)
def _(builder: Builder, closeness: Value, limit: Value) -> Value:
    kind, zero = vector(ir.IntType(16), 64), ir.Constant(LONG, 0)
    least = splat(builder, limit, kind)
    bits = bits_of_lanes(builder, builder.icmp_unsigned("<=", load_at(builder, closeness, kind), least))
    return builder.select(builder.icmp_signed("<", limit, zero), zero, bits)


@kernel(forceinline=True)
def last_bit(word: np.uint64) -> int:
    """Return the index of the last bit that is set; one must be. LLVM makes one instruction of the loop."""
    index = -1
    while word:
        word >>= np.uint64(1)
        index += 1
    return index


def running_xor(word: np.uint64) -> np.uint64:
    """Return a word whose bits are the exclusive-or of the given word's bits up to each, bit 0 the first."""
    return bits_of(np.cumsum(cells_of(word)) % 2)


@llvm_overload(running_xor, types.uint64, types.uint64)
def _(builder: Builder, word: Value) -> Value:
    if not CAN_MULTIPLY_WITHOUT_CARRY:
        return _running_xor_by_shifts(builder, word)
    # Sums without carry are exclusive-ors: the result is the lower half of the product with a word of ones.
    pair, first = vector(LONG, 2), ir.Constant(ir.IntType(32), 0)
    factor = builder.insert_element(constant(pair, 0), word, first)
    ones, halves = constant(pair, 2**64 - 1, 0), ir.Constant(ir.IntType(8), 0)
    return builder.extract_element(call(builder, "llvm.x86.pclmulqdq", pair, factor, ones, halves), first)


def _running_xor_by_shifts(builder: Builder, word: Value) -> Value:
    for count in (1, 2, 4, 8, 16, 32):
        word = builder.xor(word, builder.shl(word, ir.Constant(LONG, count)))
    return word
