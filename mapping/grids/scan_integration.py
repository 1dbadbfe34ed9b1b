"""Kernels that integrate a scan into log-odds.

Noise puts ends of beams behind walls too, into cells that no beam passes through, so that no later scan
corrects them: walls would grow thick from behind. If a beam ends behind an occupied cell, within the
distance that noise explains, its end is therefore moved into that cell. A single hit makes a cell occupied:
beams that pass in front of a wall correct a stray hit. A cell next to a free one may be the surface of an
obstacle, such as the next piece of a wall along which a beam grazes: its returns stay.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.scan_geometry import beam_directions
from lidarium.mapping.grids.scan_polygon import fill_scan_polygon, scan_ends, window_rows, window_words
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.cells import prefetch, update_block
from lidarium.mapping.kernels.views import scratch_vector, vector_at

DEVIATIONS = 3.0
"""Noise explains this number of its standard deviations, and one cell."""

STEP = 0.5
"""Beams are walked back from their ends in steps of this size [cells]."""


@kernel(forceinline=True, nrt=False)
def _is_beside_free(log_odds: Array, row: int, column: int) -> bool:
    """Whether one of the four neighbours of a cell is free, so that it may be the surface of a wall."""
    rows, columns = log_odds.shape
    is_row, is_column = 0 <= row < rows, 0 <= column < columns
    return bool(
        (is_column and 0 < row <= rows and log_odds[row - 1, column] < 0)
        or (is_column and -1 <= row < rows - 1 and log_odds[row + 1, column] < 0)
        or (is_row and 0 < column <= columns and log_odds[row, column - 1] < 0)
        or (is_row and -1 <= column < columns - 1 and log_odds[row, column + 1] < 0)
    )


@kernel(nrt=False)
def _unsettled(
    log_odds: Array,
    x: float,
    y: float,
    lengths: Array,
    directions: Array,
    is_hit: Array,
    occupied: int,
    listed: Array,
) -> int:
    """List the returns that have to be examined; return their number.

    These are the returns at the map's border, and those in cells that are neither occupied, as most are, nor next
    to a free one. The list is made without branches, which could not be predicted.
    """
    rows, columns = log_odds.shape
    beams = lengths.shape[0]
    cells, is_inner = scratch_vector(beams, np.int32), scratch_vector(beams, np.bool_)
    for beam in range(beams):
        row = np.int32(math.floor(y + lengths[beam] * directions[1, beam]))
        column = np.int32(math.floor(x + lengths[beam] * directions[0, beam]))
        is_inner[beam] = (row > 0) & (row < rows - 1) & (column > 0) & (column < columns - 1)
        cells[beam] = row * np.int32(columns) + column
    count = np.uintp(0)
    flat = vector_at(log_odds.ctypes.data, rows * columns, np.int8)
    above, beside = np.uintp(columns), np.uintp(1)
    for beam in range(beams):
        if not is_hit[beam]:
            continue
        listed[count] = beam
        if is_inner[beam]:
            cell = np.uintp(cells[beam])
            # The sign of the four together is that of the lowest.
            around = flat[cell - beside] | flat[cell + beside] | flat[cell - above] | flat[cell + above]
            count += np.uintp((around >= 0) & (flat[cell] < occupied))
        else:
            count += np.uintp(1)
    return int(count)


@kernel(nrt=False)
def settle_returns(
    log_odds: Array,
    x: float,
    y: float,
    lengths: Array,
    directions: Array,
    is_hit: Array,
    noise: tuple[float, float],
    occupied: int,
) -> None:
    """Shorten the beams that end just behind an occupied cell, so that they end in it.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map so far.
    x, y : float
        Position of the laser [cells].
    lengths : (beams,) float64
        Lengths of the beams [cells]; changed in pose.
    directions : (2 or more, beams) float64
        Their directions in the map.
    is_hit : (beams,) bool
        Whether the beam has hit something; the others keep their lengths.
    noise : (float, float)
        Standard deviation of the ranges: the larger of the first [cells] and the second, a share of the
        length.
    """
    rows, columns = log_odds.shape
    deviation, share = noise
    listed = scratch_vector(lengths.shape[0], np.int32)
    for k in range(_unsettled(log_odds, x, y, lengths, directions, is_hit, occupied, listed)):
        beam = listed[k]
        end = lengths[beam]
        row, column = (
            int(math.floor(y + end * directions[1, beam])),
            int(math.floor(x + end * directions[0, beam])),
        )
        if _is_beside_free(log_odds, row, column):
            continue
        nearest = max(end - DEVIATIONS * max(deviation, share * end) - 1.0, 0.0)
        at = end
        while at >= nearest:
            row, column = (
                int(math.floor(y + at * directions[1, beam])),
                int(math.floor(x + at * directions[0, beam])),
            )
            if 0 <= row < rows and 0 <= column < columns and log_odds[row, column] >= occupied:
                lengths[beam] = at
                break
            at -= STEP


WORD = 64


ROWS_AHEAD = 12
"""Number of rows by which memory is fetched ahead of the update."""


@kernel(nrt=False)
def _note_hits(ends: Array, is_hit: Array, hit_bits: Array) -> None:
    """Set the bits of the cells in which beams ended."""
    flat, words = hit_bits.reshape(-1), hit_bits.shape[1]
    for beam in range(is_hit.shape[0]):
        row, column = int(ends[1, beam]), int(ends[0, beam])
        flat[np.uintp(row * words + (column >> 6))] |= np.uint64(is_hit[beam]) << np.uint64(column & 63)


class SeenScan(NamedTuple):
    """The area that a scan has seen, in a window of bits.

    Attributes
    ----------
    bits, hit_bits : (window rows, words) uint64
        The seen area of ``fill_scan_polygon``, and zeros (the hits are noted).
    box : tuple of int
        The box of the window that may hold bits; the ends of the beams lie in it.
    ends, is_hit : (2, beams) float64 and (beams,) bool
        End points of the beams in the window [cells], and whether they have hit something.
    row_offset, column_offset : int
        Index of the window's first cell in the map; column_offset a multiple of 64.
    """

    bits: NDArray[np.uint64]
    hit_bits: NDArray[np.uint64]
    box: tuple[int, int, int, int]
    ends: NDArray[np.float64]
    is_hit: NDArray[np.bool_]
    row_offset: int
    column_offset: int


@kernel(nrt=False)
def integrate_scan(log_odds: Array, scan: SeenScan, increments: Array, touched: Array) -> None:
    """Update a map by a scan: lower seen cells and raise cells in which beams ended, each once.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map; columns a multiple of 64.
    increments : (4,) int64
        ``OccupancySettings.increments``.
    touched : (rows + rows / 64, words) uint64
        Bits of the words of 64 cells of each row in which a level has changed, and of these rows
        (``pooled_maps.untouched``); added to, unless it has no rows.
    """
    bits, hit_bits, box, ends, is_hit, row_offset, column_offset = scan
    _note_hits(ends, is_hit, hit_bits)
    hit, miss, minimum, maximum = increments[0], increments[1], increments[2], increments[3]
    rows, columns = log_odds.shape
    words, word_offset = columns // WORD, column_offset // WORD
    word_low, word_high = max(box[2], -word_offset), min(box[3], words - word_offset)
    is_noted = touched.shape[0] > 0
    row_low, row_high = max(box[0], -row_offset), min(box[1], rows - row_offset)
    for row in range(row_low, row_high):
        address = log_odds.ctypes.data + (row + row_offset) * columns + word_offset * WORD
        # The rows of a map lie too far apart for the processor to foresee them.
        ahead = address + min(ROWS_AHEAD, row_high - 1 - row) * columns
        changes = np.uint64(0)
        for word in range(word_low, word_high):
            seen, hits = bits[row, word], hit_bits[row, word]
            prefetch(ahead + word * WORD)
            if seen | hits != np.uint64(0):
                changed = update_block(address + word * WORD, seen, hits, hit, miss, minimum, maximum)
                changes |= np.uint64(changed != np.uint64(0)) << np.uint64((word + word_offset) & 63)
            is_last_of_group = word + 1 == word_high or (word + 1 + word_offset) & 63 == 0
            if is_last_of_group and is_noted and changes != np.uint64(0):
                of_map = row + row_offset
                touched[of_map, (word + word_offset) >> 6] |= changes
                touched[rows + (of_map >> 6), 0] |= np.uint64(1) << np.uint64(of_map & 63)
                changes = np.uint64(0)


@kernel
def integrate_one(
    log_odds: Array,
    pose: tuple[float, float, float],
    ranges: Array,
    geometry: tuple[float, float, float, float],
    unit_vectors: Array,
    increments: Array,
    noise: tuple[float, float],
    window: Array,
) -> None:
    """Update a map by one scan at x, y [cells], heading.

    ``geometry`` is (increment, range_max [cells], cells per metre, full circle).
    """
    x, y, heading = pose
    reach, scale = geometry[1], geometry[2]
    beams = ranges.shape[0]
    directions = np.empty((4, beams))
    beam_directions(heading, unit_vectors, directions)
    lengths, ends = np.empty(beams), np.empty((2, beams))
    is_hit = np.empty(beams, np.bool_)
    for beam in range(beams):
        value = float(ranges[beam])
        is_hit[beam] = 0.0 < value < math.inf and value * scale <= reach
        lengths[beam] = min(value * scale, reach) if value > 0.0 else 0.0
    if noise[0] > 0.0 or noise[1] > 0.0:
        in_cells = (noise[0] * scale, noise[1])
        settle_returns(log_odds, x, y, lengths, directions, is_hit, in_cells, increments[0])
    bits = np.zeros((window_rows(reach), window_words(reach)), np.uint64)
    margin = int(reach) + 3
    row_offset = int(math.floor(y)) - margin
    column_offset = ((int(math.floor(x)) - margin) >> 6) << 6
    local_x, local_y = x - column_offset, y - row_offset
    scan_ends(lengths, directions, local_x, local_y, ends)
    box = fill_scan_polygon(lengths, directions, ends, local_x, local_y, geometry[0], geometry[3] != 0.0, bits)
    window[0], window[1] = box[0] + row_offset, box[1] + row_offset
    window[2], window[3] = 64 * box[2] + column_offset, 64 * box[3] + column_offset
    seen = SeenScan(bits, np.zeros_like(bits), box, ends, is_hit, row_offset, column_offset)
    integrate_scan(log_odds, seen, increments, np.empty((0, 1), np.uint64))
