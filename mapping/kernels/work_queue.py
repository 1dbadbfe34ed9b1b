"""Dynamic distribution of a loop's work among threads.

Each thread takes the next item that is left, so that all end at about the same time. The result does not
depend on the thread that takes an item; items must not write to each other's memory.
"""

from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.llvm import LONG, Builder, Value, llvm_overload, pointer_at
from lidarium.mapping.kernels.views import vector_at


class Work(NamedTuple):
    """Items that threads work off, each taking the next one that is left.

    Attributes
    ----------
    items : (n,) int64
        The items, in the order in which they are taken.
    taken : (1,) int64
        The number of items that have been taken, see ``take_next``.
    threads : int
        The number of threads that take items.
    first : int
        The number of the first of them, which tells the scratch memory of threads apart.
    """

    items: NDArray[np.int64]
    taken: NDArray[np.int64]
    threads: int
    first: int


def new_work(items: NDArray[np.int64], threads: int) -> Work:
    """Return work of which nothing has been taken."""
    return Work(items, new_queue(), threads, 0)


def new_queue() -> NDArray[np.int64]:
    """Return the counter of a loop that has not begun, for ``take_next``."""
    return np.zeros(1, np.int64)


def _add_one(address: int) -> int:
    """Increment the int64 at an address, atomically in kernels; return the number before."""
    counter = vector_at(address, 1, np.int64)
    counter[0] += 1
    return int(counter[0]) - 1


@llvm_overload(_add_one, types.int64, types.int64)
def _(builder: Builder, address: Value) -> Value:
    return builder.atomic_rmw("add", pointer_at(builder, address, LONG), ir.Constant(LONG, 1), "monotonic")


@kernel(inline="always")
def share_of(work: Work, thread: int) -> Work:
    """Return the work as one of its threads takes part in it (kernel)."""
    return Work(work.items, work.taken, np.int64(1), np.int64(thread))  # type: ignore[arg-type]


@kernel(forceinline=True)
def take_next(taken: Array) -> int:
    """Return the index of the next item by the counter of ``new_queue``; no two threads get the same."""
    return _add_one(taken.ctypes.data)
