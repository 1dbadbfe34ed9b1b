"""The area that a scan has seen, as bits: one bit per cell, rows of 64-bit words.

A scan is a star-shaped polygon: the laser's position and the end points of the beams in order. Neighbouring
beams span a fan between them. Where their ranges differ so much that no surface seen at more than about seven
degrees could join the two end points, the fan ends at the nearer range: nothing is claimed about what lies
behind an edge. A cell is seen when its centre lies inside the polygon.

Each edge of the polygon toggles one bit in every row of cells whose centre line it crosses, at the first cell
centre right of the crossing; the running exclusive-or along a row is then the inside of the polygon, and
every cell is visited once however many beams crossed it.
"""

import numpy as np

from lidarium.mapping.grids.outlines.outline_edges import Outline, toggle_between, toggle_edges
from lidarium.mapping.grids.outlines.toggled_bits import row_of, toggle_edge
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.words import running_xor
from lidarium.mapping.kernels.views import scratch_vector

GRAZING = 8.0
"""Cotangent of the flattest angle at which neighbours share a surface.

Neighbours are two neighbouring end points.
"""


@kernel(forceinline=True)
def window_words(reach: float) -> int:
    """Words per row of a scan's window.

    It extends ``reach`` cells to both sides, at any alignment.
    """
    return (2 * (int(reach) + 3)) // 64 + 2


@kernel(forceinline=True)
def window_rows(reach: float) -> int:
    """Rows of a scan's window."""
    return 2 * (int(reach) + 3) + 1


@kernel(nrt=False)
def scan_ends(lengths: Array, directions: Array, x: float, y: float, ends: Array) -> None:
    """Fill ``ends`` (2, beams) with the end points of the beams in the window [cells].

    Parameters
    ----------
    lengths : (beams,) float64
        How far each beam went [cells], 0 for a beam that says nothing.
    directions : (2 or more, beams) float64
        Unit vectors of the beams in the grid's axes.
    x, y : float
        Position of the laser in the window [cells].
    ends : (2, beams) float64
        Result.
    """
    for beam in range(lengths.shape[0]):
        ends[0, beam] = x + lengths[beam] * directions[0, beam]
    for beam in range(lengths.shape[0]):
        ends[1, beam] = y + lengths[beam] * directions[1, beam]


@kernel(nrt=False)
def fill_scan_polygon(
    lengths: Array,
    directions: Array,
    ends: Array,
    x: float,
    y: float,
    increment: float,
    is_full_circle: bool,
    bits: Array,
) -> tuple[int, int, int, int]:
    """Set the bits of the cells whose centre the scan has seen.

    Parameters
    ----------
    lengths, directions, ends : arrays
        As for ``scan_ends``.
    x, y : float
        Position of the laser in the window [cells]; at least the longest range plus 2 from its borders.
    increment : float
        Angle between neighbouring beams [rad].
    is_full_circle : bool
        Whether the last beam is a neighbour of the first.
    bits : (rows, words) uint64
        Zero on entry; row 0 at the lowest y, bit 0 of word 0 at the lowest x.

    Returns
    -------
    row_low, row_high, word_low, word_high : int
        The box that may hold bits, high ends exclusive.
    """
    beams = lengths.shape[0]
    flat, width = bits.ctypes.data, 64 * bits.shape[1]
    outline = Outline(lengths, directions, ends, x, y, GRAZING * increment)
    if is_full_circle:
        toggle_between(flat, width, outline, beams - 1, 0)
    else:
        own_row = row_of(y)
        for beam in (0, beams - 1):
            end_row = row_of(ends[1, beam])
            if end_row != own_row:
                toggle_edge(flat, width, ends[0, beam], ends[1, beam], x, y, end_row, own_row)
    rows, columns = scratch_vector(beams, np.int32), scratch_vector(beams, np.int32)
    for beam in range(beams):
        rows[beam], columns[beam] = np.int32(ends[1, beam] + 0.5), np.int32(ends[0, beam])
    low_row, high_row, low_column, high_column = np.int32(y), np.int32(y), np.int32(x), np.int32(x)
    for beam in range(beams):
        low_row, high_row = min(low_row, rows[beam]), max(high_row, rows[beam])
        low_column, high_column = min(low_column, columns[beam]), max(high_column, columns[beam])
    toggle_edges(flat, width, outline, rows)
    box = (
        max(int(low_row) - 2, 0),
        min(int(high_row) + 2, bits.shape[0]),
        max(int(low_column) - 1, 0) >> 6,
        min((int(high_column) + 2) >> 6, bits.shape[1] - 1) + 1,
    )
    _fill_rows(bits, box)
    return box


@kernel(forceinline=True, nrt=False)
def _fill_rows(bits: Array, box: tuple[int, int, int, int]) -> None:
    """Set the bits between those toggled, in the rows and words of a box."""
    row_low, row_high, word_low, word_high = box
    for i in range(row_low, row_high):
        carry = np.uint64(0)
        for word in range(word_low, word_high):
            value = running_xor(bits[i, word]) ^ carry
            bits[i, word] = value
            carry = np.uint64(0) - (value >> np.uint64(63))
