"""Operations on words of 64 bits, one bit for each cell.

They take many steps to write and few instructions to execute.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python import plain_forms
from lidarium.mapping.kernels.in_python.interpreted import machine_code
from lidarium.mapping.kernels.processor import has_feature

_WORD = ir.IntType(64)


def _place_of_first(typing_context: Any, word: Any) -> Any:  # noqa: ANN401
    """Tell which is the first bit that is set."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.uint64), generate


def _place_of_last(typing_context: Any, word: Any) -> Any:  # noqa: ANN401
    """Tell which is the last bit that is set."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        before = builder.ctlz(arguments[0], ir.Constant(ir.IntType(1), 1))
        return builder.sub(ir.Constant(_WORD, 63), before)

    return types.int64(types.uint64), generate


def _multiply_without_carry(builder: Any, word: Any) -> Any:  # noqa: ANN401
    """Return the lower half of the carry-less product with a word of ones.

    Sums are exclusive-ors, so the product is their running sum.
    """
    insert: Any = cgutils.get_or_insert_function
    pair = ir.VectorType(_WORD, 2)
    first, zero = ir.Constant(ir.IntType(32), 0), ir.Constant(pair, [0, 0])
    kind = ir.FunctionType(pair, [pair, pair, ir.IntType(8)])
    multiply = insert(builder.module, kind, "llvm.x86.pclmulqdq")
    ones = ir.Constant(pair, [2**64 - 1, 0])
    product = builder.call(
        multiply, [builder.insert_element(zero, word, first), ones, ir.Constant(ir.IntType(8), 0)]
    )
    return builder.extract_element(product, first)


def _running_xor(typing_context: Any, word: Any) -> Any:  # noqa: ANN401
    """Write into each bit the exclusive-or of all bits up to it."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        value = arguments[0]
        if CAN_MULTIPLY_WITHOUT_CARRY:
            return _multiply_without_carry(builder, value)
        for places in (1, 2, 4, 8, 16, 32):
            value = builder.xor(value, builder.shl(value, ir.Constant(_WORD, places)))
        return value

    return types.uint64(types.uint64), generate


CAN_MULTIPLY_WITHOUT_CARRY = has_feature("pclmul")
"""Whether the processor multiplies without carrying."""

_first = machine_code(_place_of_first, plain_forms.first_bit)
_last = machine_code(_place_of_last, plain_forms.last_bit)
_run = machine_code(_running_xor, plain_forms.running_xor)


@kernel(inline=True)
def first_bit(word: np.uint64) -> int:
    """Return which bit of a word is the first that is set; one must be."""
    place: int = _first(word)
    return place


@kernel(inline=True)
def last_bit(word: np.uint64) -> int:
    """Return which bit of a word is the last that is set; one must be."""
    place: int = _last(word)
    return place


@kernel(inline=True)
def running_xor(word: np.uint64) -> np.uint64:
    """Return the running exclusive-or of a word's bits.

    Each bit is the exclusive-or of the given word's bits up to it, bit 0 the first.
    """
    value: np.uint64 = _run(word)
    return value
