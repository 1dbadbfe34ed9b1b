"""Bits that a straight edge toggles: one in every row of cells whose centre line it crosses."""

import numpy as np

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.views import vector_at


@kernel(forceinline=True, nrt=False)
def toggle_bit(bits: int, place: int) -> None:
    """Toggle a bit of the words at an address.

    Words are reached by address throughout: numba counts who holds an array whenever it is handed on or a
    part of it is taken, which for the few bits of an edge would cost more than the edge.
    """
    vector_at(bits + (place >> 6 << 3), 1, np.uint64)[0] ^= np.uint64(1) << np.uint64(place & 63)


@kernel(forceinline=True, nrt=False)
def toggle_edge(
    bits: int, width: int, from_x: float, from_y: float, to_x: float, to_y: float, from_row: int, to_row: int
) -> None:
    """Toggle the cell centres right of the edge, in the rows between its ends.

    Rows have ``width``. The interval is half open, so that corners count once.
    """
    slope = (to_x - from_x) / (to_y - from_y)
    first, last = min(from_row, to_row), max(from_row, to_row)
    x = from_x + (first + 0.5 - from_y) * slope + 0.5
    for start in range(first * width, last * width, width):
        toggle_bit(bits, start + int(x))
        x += slope


@kernel(forceinline=True)
def row_of(y: float) -> int:
    """First row whose centre line is above y; y is not negative."""
    return int(y + 0.5)
