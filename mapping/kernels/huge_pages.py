"""Blank memory that the system provides on first access.

In few large pages where it can.

Kernels go through the maps of many robots in each step. In pages of 4 KiB, the maps of a hundred robots take
more pages than the processor remembers the places of, and looking a place up takes longer than loading a line
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
"""Memory is asked for in pieces of at least this size [bytes].

What is not touched of a piece takes no room.
"""

LARGEST_PIECE = 2**24
"""Pieces grow up to this size [bytes], as more is asked for."""

LARGE_PAGE = 2**21
"""A large page [bytes]."""

MOST_IN_LARGE_PAGES = 2**27
"""Largest expected size for which large pages are used [bytes].

A large page takes up memory as a whole as soon as a part of it is accessed.
"""

Number = TypeVar("Number", bound=np.generic)


class ArrayPool:
    """Blank memory for arrays, one beside the other.

    What numpy allocates may come from memory that was used before, which has to be written over as a whole.
    An array keeps the memory of all alive that came from one piece.

    Parameters
    ----------
    expected : int
        About how much will be asked for [bytes].
    """

    def __init__(self, expected: int = PIECE) -> None:
        self._piece = min(max(expected, PIECE), LARGEST_PIECE)
        self._is_large = expected <= MOST_IN_LARGE_PAGES
        self._left = np.zeros(0, np.uint8)

    def blank(self, shape: tuple[int, ...], kind: type[Number]) -> NDArray[Number]:
        """Return an array of zeros that begins on a line of the caches."""
        size = math.prod(shape) * np.dtype(kind).itemsize
        if size > self._piece // 2:
            # Large ones have a piece of their own, so that none is left over by half.
            return _private_memory(size, self._is_large)[:size].view(kind).reshape(shape)
        if size > self._left.size:
            self._left = _private_memory(self._piece, self._is_large)
        array = self._left[:size].view(kind).reshape(shape)
        self._left = self._left[-(-size // LINE) * LINE :]
        return array


def _private_memory(size: int, is_large: bool) -> NDArray[np.uint8]:
    """Return blank memory that a fork of this process does not share.

    If asked for, in large pages where there is room for some.
    """
    is_private = hasattr(mmap, "MAP_PRIVATE")
    memory = (
        mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        if is_private
        else mmap.mmap(-1, size)
    )
    if is_large and size >= 2 * LARGE_PAGE and hasattr(mmap, "MADV_HUGEPAGE"):
        # Systems may be built without.
        with suppress(OSError):
            memory.madvise(mmap.MADV_HUGEPAGE)
    return np.frombuffer(memory, np.uint8)
