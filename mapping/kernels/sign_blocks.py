"""Signs of blocks of 64 cells at once, as bits; see ``cell_blocks``."""

from typing import Any

import numpy as np
from numba import types

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python import plain_forms
from lidarium.mapping.kernels.in_python.interpreted import machine_code
from lidarium.mapping.kernels.vectors import BYTES, INT64, NO_BYTES, NO_SHORTS, SHORTS, load_at


def _negative_block(typing_context: Any, block: Any) -> Any:  # noqa: ANN401
    """Tell which log-odds of a block are less than 0."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        return builder.bitcast(
            builder.icmp_signed("<", load_at(builder, arguments[0], BYTES), NO_BYTES), INT64
        )

    return types.uint64(types.int64), generate


def _positive_block(typing_context: Any, block: Any) -> Any:  # noqa: ANN401
    """Tell which log-odds of a block are more than 0."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        return builder.bitcast(
            builder.icmp_signed(">", load_at(builder, arguments[0], BYTES), NO_BYTES), INT64
        )

    return types.uint64(types.int64), generate


def _sign_bits(typing_context: Any, sums: Any) -> Any:  # noqa: ANN401
    """Tell which cells of a block of sums are below and which are above 0."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        total = load_at(builder, arguments[0], SHORTS)
        below, above = (
            builder.bitcast(builder.icmp_signed(order, total, NO_SHORTS), INT64) for order in "<>"
        )
        return context.make_tuple(builder, signature.return_type, (below, above))

    pair: Any = types.UniTuple
    return pair(types.uint64, 2)(types.int64), generate


_signs = machine_code(_sign_bits, plain_forms.sign_bits)
_negative = machine_code(_negative_block, plain_forms.negative_cells)
_positive = machine_code(_positive_block, plain_forms.positive_cells)


@kernel(inline=True)
def sign_bits(address: int) -> tuple[np.uint64, np.uint64]:
    """Return which of 64 int16 at an address are below 0, and which above.

    Bit 0 is the first one.
    """
    return _signs(address)  # type: ignore[no-any-return]


@kernel(inline=True)
def negative_cells(address: int) -> np.uint64:
    """Return which of the 64 int8 at an address are less than 0, bit 0 the first one."""
    return _negative(address)  # type: ignore[no-any-return]


@kernel(inline=True)
def positive_cells(address: int) -> np.uint64:
    """Return which of the 64 int8 at an address are more than 0, bit 0 the first one."""
    return _positive(address)  # type: ignore[no-any-return]
