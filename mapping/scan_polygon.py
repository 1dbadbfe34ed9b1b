"""The area that a scan has seen, as bits: one bit per cell, rows of 64-bit words.

A scan is a star-shaped polygon: the laser's position and the end points of the beams in order. Neighbouring beams span a
fan between them. Where their ranges differ so much that no surface seen at more than about seven degrees could join the
two end points, the fan ends at the nearer range: nothing is claimed about what lies behind an edge. A cell is seen when
its centre lies inside the polygon.

Each edge of the polygon toggles one bit in every row of cells whose centre line it crosses, at the first cell centre right
of the crossing; the running exclusive-or along a row is then the inside of the polygon, and every cell is visited once
however many beams crossed it.
"""

import math

import numpy as np

from lidarium.mapping.kernels import kernel

GRAZING = 8.0
"""Cotangent of the flattest angle under which two neighbouring end points still belong to one surface."""


@kernel(inline=True)
def window_words(reach):  # noqa: ANN001, ANN201
    """Words per row of a scan's window: ``reach`` cells to both sides, from any alignment."""
    return (2 * (int(reach) + 3)) // 64 + 2


@kernel(inline=True)
def window_rows(reach):  # noqa: ANN001, ANN201
    """Rows of a scan's window."""
    return 2 * (int(reach) + 3) + 1


@kernel(inline=True)
def _toggle_edge(bits, from_x, from_y, to_x, to_y):  # noqa: ANN001, ANN202
    """Toggle the cell centres right of the edge, in the rows between its ends (half open, so that corners count once)."""
    first = int(math.ceil(from_y - 0.5))
    last = int(math.ceil(to_y - 0.5))
    if first == last:
        return
    slope = (to_x - from_x) / (to_y - from_y)
    if first > last:
        first, last = last, first
    x = from_x + (first + 0.5 - from_y) * slope + 0.5
    for row in range(first, last):
        column = int(x)
        bits[row, column >> 6] ^= np.uint64(1) << np.uint64(column & 63)
        x += slope


@kernel
def fill_scan_polygon(ranges, directions, x, y, increment, is_full_circle, bits):  # noqa: ANN001, ANN201
    """Set the bits of the cells whose centre the scan has seen.

    Parameters
    ----------
    ranges : (beams,) float64
        How far each beam went [cells], 0 for a beam that says nothing.
    directions : (2 or more, beams) float64
        Unit vectors of the beams in the grid's axes.
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
    row_low, row_high : int
        The rows that may hold bits, the second exclusive.
    """
    beams = ranges.shape[0]
    last_range = ranges[beams - 1]
    last_x = x + last_range * directions[0, beams - 1]
    last_y = y + last_range * directions[1, beams - 1]
    low, high = min(y, last_y), max(y, last_y)
    if not is_full_circle:
        _toggle_edge(bits, last_x, last_y, x, y)
        first_x, first_y = x + ranges[0] * directions[0, 0], y + ranges[0] * directions[1, 0]
        _toggle_edge(bits, x, y, first_x, first_y)
        last_range, last_x, last_y = ranges[0], first_x, first_y
        low, high = min(low, first_y), max(high, first_y)
    steepness = GRAZING * increment
    previous = beams - 1 if is_full_circle else 0
    for beam in range(0 if is_full_circle else 1, beams):
        next_range = ranges[beam]
        direction_x, direction_y = directions[0, beam], directions[1, beam]
        next_x, next_y = x + next_range * direction_x, y + next_range * direction_y
        step = next_range - last_range
        if step > 1.0 + steepness * last_range:
            between_x, between_y = x + last_range * direction_x, y + last_range * direction_y
            _toggle_edge(bits, last_x, last_y, between_x, between_y)
            _toggle_edge(bits, between_x, between_y, next_x, next_y)
        elif -step > 1.0 + steepness * next_range:
            between_x = x + next_range * directions[0, previous]
            between_y = y + next_range * directions[1, previous]
            _toggle_edge(bits, last_x, last_y, between_x, between_y)
            _toggle_edge(bits, between_x, between_y, next_x, next_y)
        else:
            _toggle_edge(bits, last_x, last_y, next_x, next_y)
        low, high = min(low, next_y), max(high, next_y)
        last_range, last_x, last_y = next_range, next_x, next_y
        previous = beam
    row_low = max(int(math.floor(low)) - 1, 0)
    row_high = min(int(math.ceil(high)) + 2, bits.shape[0])
    words = bits.shape[1]
    for row in range(row_low, row_high):
        carry = np.uint64(0)
        for word in range(words):
            value = bits[row, word]
            if value == np.uint64(0) and carry == np.uint64(0):
                continue
            value ^= value << np.uint64(1)
            value ^= value << np.uint64(2)
            value ^= value << np.uint64(4)
            value ^= value << np.uint64(8)
            value ^= value << np.uint64(16)
            value ^= value << np.uint64(32)
            value ^= carry
            bits[row, word] = value
            carry = np.uint64(0) - (value >> np.uint64(63))
    return row_low, row_high
