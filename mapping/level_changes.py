"""The three-level map of a team as two bits per cell, and what changes in it.

A cell is free where the sum of the robots' log-odds is below 0, occupied where it is above, and else unknown. Two planes of
bits hold that, one word for 64 cells of a row; what changed is told by words: which one, and which of its bits flipped.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.cell_blocks import sign_bits
from lidarium.mapping.kernels import Array, int8_at, kernel
from lidarium.mapping.occupancy import FREE, OCCUPIED, UNKNOWN, WORD


@kernel
def _add_row(address: int, total: Array) -> None:
    """Add a piece of a row of log-odds to the sums ``total`` (cells,) int16."""
    source = int8_at(address, total.size)
    for k in range(total.size):
        total[k] = np.int16(total[k] + np.int16(source[k]))


@kernel
def _add_laid_row(log_odds: Array, lay: Array, resolution: float, row: int, first: int, total: Array) -> None:
    """Add the cells of a turned map that lie below the centres of a row of the lattice, from column ``first`` on."""
    rows, columns, address = log_odds[1], log_odds[2], log_odds[0]
    cosine, sine = lay[4], lay[5]
    north = (row + 0.5) * resolution + lay[1] - lay[3]
    for k in range(total.size):
        east = (first + k + 0.5) * resolution + lay[0] - lay[2]
        own_column = int(math.floor((cosine * east + sine * north - lay[6]) / resolution))
        own_row = int(math.floor((cosine * north - sine * east - lay[7]) / resolution))
        if 0 <= own_row < rows and 0 <= own_column < columns:
            total[k] = np.int16(total[k] + np.int16(int8_at(address + own_row * columns + own_column, 1)[0]))


@kernel
def note_changes(maps: Array, lays: Array, resolution: float, boxes: Array, free: Array, occupied: Array, changes: Array) -> int:
    """Bring the planes of a team's three-level map up to date where its robots' maps may have changed.

    Parameters
    ----------
    maps : (robots, 3 or more) int64
        Address, rows and columns of each robot's log-odds, int8.
    lays : (robots, 8) float64
        How each map lies over the lattice: the lattice's corner x, y, the start's x, y [m], cosine and sine of its heading, and
        the map's corner x, y in the start's frame [m]. Of shape (0, 8) where all maps are on the lattice itself.
    resolution : float
        Side of a cell [m].
    boxes : (any, 4) int64
        What may have changed, in cells of the lattice: row_low, row_high, column_low, column_high (high ends exclusive).
    free, occupied : (rows, words) uint64
        The planes; updated.
    changes : (many, 3) uint64
        Result: number of each changed word (row * words + column), its flipped bits in ``free`` and in ``occupied``, in
        ascending order. It must have room for all words within the boxes.

    Returns
    -------
    int
        Number of changed words.
    """
    rows, words = free.shape
    total = np.empty(words * 64, np.int16)
    found = 0
    for row in range(rows):
        low, high = words, 0
        for box in range(boxes.shape[0]):
            if boxes[box, 0] <= row < boxes[box, 1]:
                low, high = min(low, max(boxes[box, 2] >> 6, 0)), max(high, min((boxes[box, 3] + 63) >> 6, words))
        if low >= high:
            continue
        sums = total[: (high - low) * 64]
        sums[:] = np.int16(0)
        for robot in range(maps.shape[0]):
            if lays.shape[0] == 0:
                _add_row(maps[robot, 0] + (row * words + low) * 64, sums)
            else:
                _add_laid_row(maps[robot], lays[robot], resolution, row, low * 64, sums)
        for word in range(low, high):
            is_free, is_occupied = sign_bits(sums.ctypes.data + (word - low) * 128)
            flipped_free, flipped_occupied = is_free ^ free[row, word], is_occupied ^ occupied[row, word]
            if flipped_free | flipped_occupied:
                changes[found, 0] = row * words + word
                changes[found, 1], changes[found, 2] = flipped_free, flipped_occupied
                free[row, word], occupied[row, word] = is_free, is_occupied
                found += 1
    return found


def levels_of_planes(free: NDArray[np.uint64], occupied: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Return the three-level map of two planes (rows, words): 0 occupied, 127 unknown, 255 free, shape (rows, words * 64)."""
    rows, words = free.shape
    is_free, is_occupied = (
        np.unpackbits(plane.astype("<u8").view(np.uint8), bitorder="little").reshape(rows, words * WORD) for plane in (free, occupied)
    )
    # In whole numbers that wrap around: 127 + 128 is free, 127 - 127 is occupied.
    return np.asarray(np.uint8(UNKNOWN) + is_free * np.uint8(FREE - UNKNOWN) - is_occupied * np.uint8(UNKNOWN - OCCUPIED), np.uint8)
