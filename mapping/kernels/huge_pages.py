"""Zeroed memory that the system provides on first access, in few large pages if possible.

Kernels go through the maps of many robots in each step. In pages of 4 KiB, the maps of a hundred robots take
more pages than the processor keeps addresses of, and looking up an address takes longer than loading a line
from the caches.
"""

import math
import mmap
from contextlib import suppress
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.views import LINE

PIECE = 2**20
"""Minimum size of a piece of memory [bytes]; untouched parts of it take no physical memory."""

LARGEST_PIECE = 2**24
"""Maximum size of a piece [bytes]: pieces grow with the expected size."""

LARGE_PAGE = 2**21
"""A large page [bytes]."""

MAX_IN_LARGE_PAGES = 2**27
"""Maximum expected size for which large pages are used [bytes].

A large page is occupied as a whole as soon as a part of it is accessed.
"""

Number = TypeVar("Number", bound=np.generic)


class ArrayPool:
    """Zeroed memory for arrays, next to each other.

    Memory of numpy may have been used before, and would have to be zeroed as a whole. An array keeps the
    memory of all arrays of its piece alive.

    Parameters
    ----------
    expected : int
        Approximate total size [bytes].
    """

    def __init__(self, expected: int = PIECE) -> None:
        self._piece = min(max(expected, PIECE), LARGEST_PIECE)
        self._is_large = expected <= MAX_IN_LARGE_PAGES
        self._left = np.zeros(0, np.uint8)

    def blank(self, shape: tuple[int, ...], dtype: type[Number]) -> NDArray[Number]:
        """Return an array of zeros that begins on a line of the caches."""
        size = math.prod(shape) * np.dtype(dtype).itemsize
        if size > self._piece // 2:
            # Large ones have a piece of their own, so that none is left over by half.
            return _private_memory(size, self._is_large)[:size].view(dtype).reshape(shape)
        if size > self._left.size:
            self._left = _private_memory(self._piece, self._is_large)
        array = self._left[:size].view(dtype).reshape(shape)
        self._left = self._left[-(-size // LINE) * LINE :]
        return array


def _private_memory(size: int, is_large: bool) -> NDArray[np.uint8]:
    """Return zeroed memory that a fork of this process does not share.

    It is in large pages if asked for and possible.
    """
    is_private = hasattr(mmap, "MAP_PRIVATE")
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS) if is_private else mmap.mmap(-1, size)
    if is_large and size >= 2 * LARGE_PAGE and hasattr(mmap, "MADV_HUGEPAGE"):
        # Systems may be built without.
        with suppress(OSError):
            memory.madvise(mmap.MADV_HUGEPAGE)
    return np.frombuffer(memory, np.uint8)
