"""Dynamic distribution of a loop's work among threads.

Each thread takes the next free piece of work, so that all end at about the same time.

Which thread runs a piece changes nothing in it; pieces must not touch each other.
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.in_python import plain_forms
from lidarium.mapping.kernels.in_python.interpreted import machine_code


class Work(NamedTuple):
    """Items that threads work off, each taking the next one that is left.

    Attributes
    ----------
    items : (n,) int64
        What there is to do, in the order in which it is taken.
    taken : (1,) int64
        How many have been taken, see ``take_next``.
    threads : int
        How many threads take items.
    """

    items: NDArray[np.int64]
    taken: NDArray[np.int64]
    threads: int


def new_work(items: NDArray[np.int64], threads: int) -> Work:
    """Return work of which nothing has been taken."""
    return Work(items, new_queue(), threads)


def new_queue() -> NDArray[np.int64]:
    """Return the counter of a loop that has not begun, for ``take_next``."""
    return np.zeros(1, np.int64)


def _add_one(typing_context: Any, address: Any) -> Any:  # noqa: ANN401
    """Count on at an address, as one act for all threads."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:  # noqa: ANN401
        number = ir.IntType(64)
        return builder.atomic_rmw(
            "add", builder.inttoptr(arguments[0], number.as_pointer()), ir.Constant(number, 1), "monotonic"
        )

    return types.int64(address), generate


_take = machine_code(_add_one, plain_forms.add_one)


@kernel(inline=True)
def take_next(taken: Array) -> int:
    """Return the place of the next item by the counter of ``new_queue``, from 0 on.

    No two threads are given the same.
    """
    place: int = _take(taken.ctypes.data)
    return place
