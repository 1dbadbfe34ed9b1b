"""Edges of an outline: those between neighbouring beams, and those along a far beam behind an edge."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.outlines.toggled_bits import row_of, toggle_bit, toggle_edge
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import scratch_vector

JUMP = np.uint8(255)
"""Mark of an edge that is traced by itself.

Such an edge leads from a near to a far end point, or crosses more rows than a byte holds.
"""


class Outline(NamedTuple):
    """The outline of what a scan has seen.

    Attributes
    ----------
    lengths, directions, ends
        As for ``scan_ends``.
    x, y : float
        Position of the laser in the window [cells].
    steepness : float
        By how much of the nearer range the ranges of neighbours on one surface differ at most.
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
        Rows that each crosses, or ``JUMP``.
    first, second : (edges,) int32
        Bits toggled in the first two of them.
    crossings, slopes : (edges,) float64
        Where its line crosses the first row, and by how much farther each one after it.
    """

    crossed: NDArray[np.uint8]
    first: NDArray[np.int32]
    second: NDArray[np.int32]
    crossings: NDArray[np.float64]
    slopes: NDArray[np.float64]


@kernel(forceinline=True, nrt=False)
def toggle_between(bits: int, width: int, outline: Outline, previous: int, beam: int) -> None:
    """Toggle the outline between the end points of two neighbouring beams."""
    lengths, directions, ends, x, y, steepness = outline
    step = lengths[beam] - lengths[previous]
    if abs(step) <= 1.0 + steepness * min(lengths[beam], lengths[previous]):
        from_row, to_row = row_of(ends[1, previous]), row_of(ends[1, beam])
        if from_row != to_row:
            toggle_edge(
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
    row = row_of(corner_y)
    for end in (near, far):
        end_row = row_of(ends[1, end])
        if end_row != row:
            toggle_edge(bits, width, ends[0, end], ends[1, end], corner_x, corner_y, end_row, row)


@kernel(nrt=False)
def _find_edges(
    lengths: Array, ends: Array, rows: Array, steepness: float, width: int, found: _Edges
) -> None:
    """Compute the rows crossed, the toggled bits and the line of each edge.

    An edge joins a beam to the next. Loops without branches over few arrays, which LLVM runs on vectors.
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
def toggle_edges(flat: int, width: int, outline: Outline, rows: Array) -> None:
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
            toggle_between(flat, width, outline, k, k + 1)
            continue
        # Most edges cross two rows, one or none. What they toggle is listed without branches, which could not
        # be foreseen.
        toggles[listed] = first[k]
        listed += np.uintp(count > 0)
        toggles[listed] = second[k]
        listed += np.uintp(count > 1)
        if count > 2:
            start, crossing = min(rows[k], rows[k + 1]) * width + width, crossings[k] + slopes[k]
            for _ in range(2, count):
                start += width
                crossing += slopes[k]
                toggle_bit(flat, start + int(crossing))
    for k in range(listed):
        toggle_bit(flat, toggles[k])
