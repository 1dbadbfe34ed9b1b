"""Returns with noise: one that ends just behind a known wall has met that wall.

Noise puts ends of beams behind walls too, into cells that no beam passes through, so that no later scan takes
them back: walls grow thick from behind for as long as they are seen. So where a beam ends behind an
occupied cell, within what noise explains, its end is moved into that cell. What a single hit has marked
counts as occupied: beams that pass in front of a wall take a stray hit back.

A cell beside a free one may be the surface of something, such as the next piece of a wall along which a beam
grazes: its returns stay.
"""

import math

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import scratch_vector, vector_at

DEVIATIONS = 3.0
"""Noise explains so many of its standard deviations, and one cell."""

STEP = 0.5
"""Beams are walked back from their ends in steps of this [cells]."""


@kernel(forceinline=True, nrt=False)
def _is_beside_free(log_odds: Array, row: int, column: int) -> bool:
    """Whether one of the four neighbours of a cell is free.

    The cell may then be the surface of a wall.
    """
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
    """List the returns that have to be examined.

    Those neither in an occupied cell nor beside a free one, as most are, and those at the map's border.

    They are listed without branches, which could not be foreseen; returns how many there are.
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
        Where the laser is [cells].
    lengths : (beams,) float64
        Lengths of the beams [cells]; changed in place.
    directions : (2 or more, beams) float64
        Their directions in the map.
    is_hit : (beams,) bool
        Which of them something ended; the others keep their lengths.
    noise : (float, float)
        Standard deviation of the ranges: the larger of the first [cells] and the second, a share of the
        length.
    occupied : int
        Log-odds from which on a cell counts as occupied.
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
