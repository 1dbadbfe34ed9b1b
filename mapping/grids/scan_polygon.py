"""The area that a scan has seen, as bits: one bit per cell, rows of 64-bit words.

A scan is a star-shaped polygon: the laser's position and the end points of the beams in order. Neighbouring
beams span a fan between them. If their ranges differ by more than a surface seen at about seven degrees
would explain, the fan ends at the nearer range: nothing behind an edge counts as seen. A cell is seen if its
centre lies inside the polygon.

Each edge of the polygon toggles one bit in every row of cells whose centre line it crosses, at the first
cell centre right of the crossing. The running exclusive-or along a row is then the inside of the polygon,
and every cell is visited once, by any number of beams.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.words import running_xor
from lidarium.mapping.kernels.views import scratch_vector, vector_at


@kernel(forceinline=True, nrt=False)
def _toggle_bit(bits: int, index: int) -> None:
    """Toggle a bit of the words at an address.

    Words are accessed by address because numba counts references to an array whenever it is passed on or sliced,
    which would cost more than the few bits of an edge.
    """
    vector_at(bits + (index >> 6 << 3), 1, np.uint64)[0] ^= np.uint64(1) << np.uint64(index & 63)


@kernel(forceinline=True, nrt=False)
def _toggle_edge(
    bits: int, width: int, from_x: float, from_y: float, to_x: float, to_y: float, from_row: int, to_row: int
) -> None:
    """Toggle the cell centres right of an edge, in the rows of ``width`` cells between its ends.

    The interval is half open, so that corners count once.
    """
    slope = (to_x - from_x) / (to_y - from_y)
    first, last = min(from_row, to_row), max(from_row, to_row)
    x = from_x + (first + 0.5 - from_y) * slope + 0.5
    for start in range(first * width, last * width, width):
        _toggle_bit(bits, start + int(x))
        x += slope


@kernel(forceinline=True)
def _row_of(y: float) -> int:
    """Return the first row whose centre line is above y, which is not negative."""
    return int(y + 0.5)


JUMP = np.uint8(255)
"""Mark of an edge that is traced by itself.

It leads from a near to a far end point, or crosses more rows than a byte holds.
"""


class _Outline(NamedTuple):
    """The outline of the area that a scan has seen.

    Attributes
    ----------
    lengths, directions, ends
        As for ``scan_ends``.
    x, y : float
        Position of the laser in the window [cells].
    steepness : float
        Maximum difference of the ranges of neighbours on one surface, as a share of the nearer range.
    """

    lengths: NDArray[np.float64]
    directions: NDArray[np.float64]
    ends: NDArray[np.float64]
    x: float
    y: float
    steepness: float


class _Edges(NamedTuple):
    """The edges of an outline between neighbouring beams.

    Attributes
    ----------
    crossed : (edges,) uint8
        Number of rows that each crosses, or ``JUMP``.
    first, second : (edges,) int32
        Bits toggled in the first two of them.
    crossings, slopes : (edges,) float64
        Column at which its line crosses the first row, and the step to that of each row after it.
    """

    crossed: NDArray[np.uint8]
    first: NDArray[np.int32]
    second: NDArray[np.int32]
    crossings: NDArray[np.float64]
    slopes: NDArray[np.float64]


@kernel(forceinline=True, nrt=False)
def _toggle_between(bits: int, width: int, outline: _Outline, previous: int, beam: int) -> None:
    """Toggle the outline between the end points of two neighbouring beams."""
    lengths, directions, ends, x, y, steepness = outline
    step = lengths[beam] - lengths[previous]
    if abs(step) <= 1.0 + steepness * min(lengths[beam], lengths[previous]):
        from_row, to_row = _row_of(ends[1, previous]), _row_of(ends[1, beam])
        if from_row != to_row:
            _toggle_edge(
                bits,
                width,
                ends[0, previous],
                ends[1, previous],
                ends[0, beam],
                ends[1, beam],
                from_row,
                to_row,
            )
        return
    # Between a near and a far end point the outline goes along the far beam, up to the near range only.
    near, far = (previous, beam) if step > 0.0 else (beam, previous)
    corner_x, corner_y = x + lengths[near] * directions[0, far], y + lengths[near] * directions[1, far]
    row = _row_of(corner_y)
    for end in (near, far):
        end_row = _row_of(ends[1, end])
        if end_row != row:
            _toggle_edge(bits, width, ends[0, end], ends[1, end], corner_x, corner_y, end_row, row)


@kernel(nrt=False)
def _find_edges(lengths: Array, ends: Array, rows: Array, steepness: float, width: int, found: _Edges) -> None:
    """Compute the rows crossed, the toggled bits and the line of the edge from each beam to the next.

    Loops without branches over few arrays, which LLVM runs on vectors.
    """
    crossed, first, second, crossings, slopes = found
    edges = lengths.shape[0] - 1
    from_x, to_x, from_y, to_y = ends[0, :-1], ends[0, 1:], ends[1, :-1], ends[1, 1:]
    from_row, to_row, from_length, to_length = rows[:-1], rows[1:], lengths[:-1], lengths[1:]
    for k in range(edges):
        step = abs(to_length[k] - from_length[k])
        climb = abs(to_row[k] - from_row[k])
        is_surface = (step <= 1.0 + steepness * min(from_length[k], to_length[k])) & (climb < JUMP)
        crossed[k] = np.uint8(climb) if is_surface else JUMP
    for k in range(edges):
        slopes[k] = (to_x[k] - from_x[k]) / (to_y[k] - from_y[k])
    for k in range(edges):
        crossings[k] = from_x[k] + (min(from_row[k], to_row[k]) + 0.5 - from_y[k]) * slopes[k] + 0.5
    stride = np.int32(width)
    for k in range(edges):
        first[k] = min(from_row[k], to_row[k]) * stride + np.int32(crossings[k])
    for k in range(edges):
        second[k] = (min(from_row[k], to_row[k]) + np.int32(1)) * stride + np.int32(crossings[k] + slopes[k])


@kernel(forceinline=True, nrt=False)
def _toggle_edges(flat: int, width: int, outline: _Outline, rows: Array) -> None:
    """Toggle the outline between all end points; ``rows`` (beams,) int32 are theirs."""
    beams = rows.shape[0]
    crossed, first, second = (
        scratch_vector(beams, np.uint8),
        scratch_vector(beams, np.int32),
        scratch_vector(beams, np.int32),
    )
    crossings, slopes = scratch_vector(beams, np.float64), scratch_vector(beams, np.float64)
    edges = _Edges(crossed, first, second, crossings, slopes)
    _find_edges(outline.lengths, outline.ends, rows, outline.steepness, width, edges)
    toggles, listed = scratch_vector(2 * beams + 2, np.int32), np.uintp(0)
    for k in range(beams - 1):
        count = crossed[k]
        if count == JUMP:
            _toggle_between(flat, width, outline, k, k + 1)
            continue
        # Most edges cross two rows, one or none. Their toggles are listed without branches, which could not
        # be predicted.
        toggles[listed] = first[k]
        listed += np.uintp(count > 0)
        toggles[listed] = second[k]
        listed += np.uintp(count > 1)
        if count > 2:
            start, crossing = min(rows[k], rows[k + 1]) * width + width, crossings[k] + slopes[k]
            for _ in range(2, count):
                start += width
                crossing += slopes[k]
                _toggle_bit(flat, start + int(crossing))
    for k in range(listed):
        _toggle_bit(flat, toggles[k])


GRAZING = 8.0
"""Cotangent of the flattest angle at which the end points of neighbouring beams share a surface."""


@kernel(forceinline=True)
def window_words(reach: float) -> int:
    """Return the words per row of a scan's window: ``reach`` cells to both sides, at any alignment."""
    return (2 * (int(reach) + 3)) // 64 + 2


@kernel(forceinline=True)
def window_rows(reach: float) -> int:
    """Return the rows of a scan's window."""
    return 2 * (int(reach) + 3) + 1


@kernel(nrt=False)
def scan_ends(lengths: Array, directions: Array, x: float, y: float, ends: Array) -> None:
    """Fill ``ends`` (2, beams) with the end points of the beams in the window [cells].

    Parameters
    ----------
    lengths : (beams,) float64
        Lengths of the beams [cells], 0 for invalid ones.
    directions : (2 or more, beams) float64
        Unit vectors of the beams along the grid's axes.
    x, y : float
        Position of the laser in the window [cells].
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
    """Set the bits of the cells whose centre the scan has seen; return the box that may hold bits.

    Parameters
    ----------
    x, y : float
        Position of the laser in the window [cells]; at least the longest range plus 2 from its borders.
    increment : float
        Angle between neighbouring beams [rad].
    bits : (rows, words) uint64
        Zero on entry; row 0 at the lowest y, bit 0 of word 0 at the lowest x.
    """
    beams = lengths.shape[0]
    flat, width = bits.ctypes.data, 64 * bits.shape[1]
    outline = _Outline(lengths, directions, ends, x, y, GRAZING * increment)
    if is_full_circle:
        _toggle_between(flat, width, outline, beams - 1, 0)
    else:
        own_row = _row_of(y)
        for beam in (0, beams - 1):
            end_row = _row_of(ends[1, beam])
            if end_row != own_row:
                _toggle_edge(flat, width, ends[0, beam], ends[1, beam], x, y, end_row, own_row)
    rows, columns = scratch_vector(beams, np.int32), scratch_vector(beams, np.int32)
    for beam in range(beams):
        rows[beam], columns[beam] = np.int32(ends[1, beam] + 0.5), np.int32(ends[0, beam])
    low_row, high_row, low_column, high_column = np.int32(y), np.int32(y), np.int32(x), np.int32(x)
    for beam in range(beams):
        low_row, high_row = min(low_row, rows[beam]), max(high_row, rows[beam])
        low_column, high_column = min(low_column, columns[beam]), max(high_column, columns[beam])
    _toggle_edges(flat, width, outline, rows)
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
