"""Dynamic distribution of a loop's work among threads.

Each thread takes the next free piece of work, so that all end at about the same time.

Which thread runs a piece changes nothing in it; pieces must not touch each other.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel


def new_queue() -> NDArray[np.int64]:
    """Return the counter of a loop that has not begun, for ``take_turn``."""
    return np.zeros(1, np.int64)


def _add_one(typing_context: Any, address: Any) -> Any:  # noqa: ANN401
    """Count on at an address, as one act for all threads."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        number = ir.IntType(64)
        return builder.atomic_rmw(
            "add", builder.inttoptr(arguments[0], number.as_pointer()), ir.Constant(number, 1), "monotonic"
        )

    return types.int64(address), generate


_take: Any = intrinsic(_add_one)


@kernel(inline=True)
def take_next(turns: Array) -> int:
    """Return the number of the next turn of ``new_turns``, from 0 on.

    No two threads are given the same.
    """
    turn: int = _take(turns.ctypes.data)
    return turn
