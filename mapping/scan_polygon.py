"""The area that a scan has seen, as bits: one bit per cell, rows of 64-bit words.

A scan is a star-shaped polygon: the laser's position and the end points of the beams in order. Neighbouring beams span a
fan between them. Where their ranges differ so much that no surface seen at more than about seven degrees could join the
two end points, the fan ends at the nearer range: nothing is claimed about what lies behind an edge. A cell is seen when
its centre lies inside the polygon.

Each edge of the polygon toggles one bit in every row of cells whose centre line it crosses, at the first cell centre right
of the crossing; the running exclusive-or along a row is then the inside of the polygon, and every cell is visited once
however many beams crossed it.
"""

import numpy as np

from lidarium.mapping.kernels import Array, kernel

GRAZING = 8.0
"""Cotangent of the flattest angle under which two neighbouring end points still belong to one surface."""


@kernel(inline=True)
def window_words(reach: float) -> int:
    """Words per row of a scan's window: ``reach`` cells to both sides, from any alignment."""
    return (2 * (int(reach) + 3)) // 64 + 2


@kernel(inline=True)
def window_rows(reach: float) -> int:
    """Rows of a scan's window."""
    return 2 * (int(reach) + 3) + 1


@kernel(inline=True)
def _toggle_edge(bits: Array, from_x: float, from_y: float, to_x: float, to_y: float, from_row: int, to_row: int) -> None:
    """Toggle the cell centres right of the edge, in the rows between its ends (half open, so that corners count once)."""
    slope = (to_x - from_x) / (to_y - from_y)
    first, last = min(from_row, to_row), max(from_row, to_row)
    x = from_x + (first + 0.5 - from_y) * slope + 0.5
    for row in range(first, last):
        column = int(x)
        bits[row, column >> 6] ^= np.uint64(1) << np.uint64(column & 63)
        x += slope


@kernel(inline=True)
def _row_of(y: float) -> int:
    """First row whose centre line is not below y; y is not negative."""
    return int(y + 0.5)


@kernel
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


@kernel
def _toggle_jump(bits: Array, lengths: Array, directions: Array, ends: Array, x: float, y: float, near: int, far: int) -> None:
    """Toggle the outline between a near and a far end point: along the far beam up to the near range only."""
    corner_x = x + lengths[near] * directions[0, far]
    corner_y = y + lengths[near] * directions[1, far]
    row = _row_of(corner_y)
    for beam in (near, far):
        end_row = _row_of(ends[1, beam])
        if end_row != row:
            _toggle_edge(bits, ends[0, beam], ends[1, beam], corner_x, corner_y, end_row, row)


@kernel
def fill_scan_polygon(
    lengths: Array, directions: Array, ends: Array, x: float, y: float, increment: float, is_full_circle: bool, bits: Array
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
    if not is_full_circle:
        own_row = _row_of(y)
        for beam in (0, beams - 1):
            end_row = _row_of(ends[1, beam])
            if end_row != own_row:
                _toggle_edge(bits, ends[0, beam], ends[1, beam], x, y, end_row, own_row)
    steepness = GRAZING * increment
    previous = beams - 1 if is_full_circle else 0
    last_length, last_row = lengths[previous], _row_of(ends[1, previous])
    rows, columns = np.empty(beams, np.int32), np.empty(beams, np.int32)
    for beam in range(beams):
        rows[beam] = _row_of(ends[1, beam])
        columns[beam] = int(ends[0, beam])
    low_row, high_row, low_column, high_column = np.int32(y), np.int32(y), np.int32(x), np.int32(x)
    for beam in range(beams):
        low_row, high_row = min(low_row, rows[beam]), max(high_row, rows[beam])
        low_column, high_column = min(low_column, columns[beam]), max(high_column, columns[beam])
    toggles, listed, width = np.empty(2 * beams + 2, np.int64), 0, 64 * bits.shape[1]
    for beam in range(0 if is_full_circle else 1, beams):
        length = lengths[beam]
        row = rows[beam]
        step = length - last_length
        climb = row - last_row
        if abs(step) > 1.0 + steepness * min(length, last_length):
            if step > 0.0:
                _toggle_jump(bits, lengths, directions, ends, x, y, previous, beam)
            else:
                _toggle_jump(bits, lengths, directions, ends, x, y, beam, previous)
        elif -2 <= climb <= 2:
            # Most edges cross two rows, one or none. What they toggle is listed without branches, which could not be foreseen.
            crossed = min(row, last_row)
            from_x, from_y = ends[0, previous], ends[1, previous]
            rise = ends[1, beam] - from_y if climb != 0 else 1.0
            slope = (ends[0, beam] - from_x) / rise
            at = from_x + (crossed + 0.5 - from_y) * slope + 0.5
            second = abs(climb) >> 1
            toggles[listed] = crossed * width + int(at)
            listed += (climb & 1) | second
            toggles[listed] = (crossed + 1) * width + int(at + slope)
            listed += second
        else:
            _toggle_edge(bits, ends[0, previous], ends[1, previous], ends[0, beam], ends[1, beam], last_row, row)
        last_length, last_row = length, row
        previous = beam
    flat = bits.reshape(-1)
    for k in range(listed):
        flat[toggles[k] >> 6] ^= np.uint64(1) << np.uint64(toggles[k] & 63)
    row_low, row_high = max(int(low_row) - 2, 0), min(int(high_row) + 2, bits.shape[0])
    word_low, word_high = max(int(low_column) - 1, 0) >> 6, min((int(high_column) + 2) >> 6, bits.shape[1] - 1) + 1
    for i in range(row_low, row_high):
        carry = np.uint64(0)
        for word in range(word_low, word_high):
            value = bits[i, word]
            value ^= value << np.uint64(1)
            value ^= value << np.uint64(2)
            value ^= value << np.uint64(4)
            value ^= value << np.uint64(8)
            value ^= value << np.uint64(16)
            value ^= value << np.uint64(32)
            value ^= carry
            bits[i, word] = value
            carry = np.uint64(0) - (value >> np.uint64(63))
    return row_low, row_high, word_low, word_high
