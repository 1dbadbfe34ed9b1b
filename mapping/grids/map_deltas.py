"""The three-level map of a team as two bits per cell, and what changes in it.

A cell is free where the sum of the robots' log-odds is below 0, occupied where it is above, and else unknown.
Two planes of bits hold which cells are known and which are occupied, one word for 64 cells of a row; what
changed is told by words: which one, and which of its bits flipped. So a wall that noise moves to and fro
flips bits of one plane only. Only what the robots can have seen since the last look is looked at again.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.grids.scan_integration import WORD
from lidarium.mapping.kernels.cell_blocks import sign_bits
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import int8_at, word_grid_at

_GROUP = 8
"""Cells of a rotated map compared, or lattice cells recomputed, at once.

As many as bytes fit into a word.
"""

_ALL = np.uint64(2**64 - 1)

CORNER_X, CORNER_Y, START_X, START_Y, COSINE, SINE, ORIGIN_X, ORIGIN_Y = range(8)
"""Indices into the array that places a robot's map on the lattice.

The lattice's corner, the start and its heading, and the map's corner in the start's frame.
"""


@kernel
def _spans(poses: Array, last: Array, reach: float, frame: Array) -> Array:
    """Return the cells that robots can have seen since ``last``: (robots, 4).

    ``last`` holds their earlier places, and is set to the present ones.

    Columns and rows in the grid of ``frame`` (3,), corner and side of a cell: column_low, column_high,
    row_low, row_high.
    """
    spans = np.empty((poses.shape[0], 4), np.int64)
    for robot in range(poses.shape[0]):
        for axis in range(2):
            now, before = poses[robot, axis] - frame[axis], last[robot, axis] - frame[axis]
            spans[robot, 2 * axis] = int(math.floor((min(now, before) - reach) / frame[2]))
            spans[robot, 2 * axis + 1] = int(math.floor((max(now, before) + reach) / frame[2])) + 1
            last[robot, axis] = poses[robot, axis]
    return spans


@kernel
def _note_word(
    sums: int, where: np.uint64, row: int, word: int, known: Array, occupied: Array, change: Array
) -> bool:
    """Compare 64 sums with a word of the planes and record flipped bits.

    The sums are int16 at an address. Only bits ``where`` are compared; flips are written into ``change``
    (3,).
    """
    is_free, is_occupied = sign_bits(sums)
    flipped_known, flipped_occupied = (
        ((is_free | is_occupied) ^ known[row, word]) & where,
        (is_occupied ^ occupied[row, word]) & where,
    )
    if not flipped_known | flipped_occupied:
        return False
    known[row, word] ^= flipped_known
    occupied[row, word] ^= flipped_occupied
    change[0] = word * known.shape[0] + row
    change[1], change[2] = flipped_known, flipped_occupied
    return True


@kernel
def _add_row(address: int, total: Array) -> None:
    """Add a piece of a row of log-odds to the sums ``total`` (cells,) int16."""
    source = int8_at(address, total.size)
    for k in range(total.size):
        total[k] = np.int16(total[k] + np.int16(source[k]))


@kernel
def note_changes(
    maps: Array,
    poses: Array,
    last: Array,
    reach: float,
    frame: Array,
    known: Array,
    occupied: Array,
    changes: Array,
) -> int:
    """Update the planes of a team's map where its robots' maps may have changed.

    All robots' maps are on one lattice.

    Parameters
    ----------
    maps : (robots, 3 or more) int64
        Address of each robot's log-odds (int8) at the lattice's first cell, and rows and columns of its map,
        which may be larger.
    poses, last : (robots, 2 or more), (robots, 2) float64
        Where the robots are, and where they were at the last look (updated) [m].
    reach : float
        How far from either place a robot can have seen [m].
    frame : (3,) float64
        Lower left corner x, y and side of a cell of the lattice [m].
    known, occupied : (rows, words) uint64
        The planes; updated.
    changes : (rows * words, 3) uint64
        Result: place of each changed word (column of words * rows + row), its flipped bits in ``known`` and
        in ``occupied``.

    Returns
    -------
    int
        Number of changed words.
    """
    rows, words = known.shape
    spans = _spans(poses, last, reach, frame)
    total = np.empty(words * 64, np.int16)
    found = 0
    for row in range(max(spans[:, 2].min(), 0), min(spans[:, 3].max(), rows)):
        low, high = words, 0
        for robot in range(spans.shape[0]):
            if spans[robot, 2] <= row < spans[robot, 3]:
                low, high = (
                    min(low, max(spans[robot, 0] >> 6, 0)),
                    max(high, min((spans[robot, 1] + 63) >> 6, words)),
                )
        if low >= high:
            continue
        sums = total[: (high - low) * 64]
        sums[:] = np.int16(0)
        for robot in range(maps.shape[0]):
            _add_row(maps[robot, 0] + row * maps[robot, 2] + low * 64, sums)
        for word in range(low, high):
            if _note_word(
                sums.ctypes.data + (word - low) * 128, _ALL, row, word, known, occupied, changes[found]
            ):
                found += 1
    return found


class LaidMaps(NamedTuple):
    """Maps in frames of their robots' own starts, laid over a lattice.

    Attributes
    ----------
    maps : (robots, 3 or more) int64
        As for ``note_changes``; columns of the maps are a multiple of 8.
    before : (robots,) int64
        Addresses of the maps as they were at the last look, blank at the first; updated.
    lays : (robots, 8) float64
        How each map lies over the lattice: corner x, y of the lattice, start x, y, cosine and sine of the
        start's heading, and corner x, y of the map in the start's frame [m].
    resolution : float
        Side of a cell [m].
    """

    maps: NDArray[np.int64]
    before: NDArray[np.int64]
    lays: NDArray[np.float64]
    resolution: float


@kernel
def _mark_stale(
    log_odds: Array, before: int, lay: Array, resolution: float, span: Array, stale: Array
) -> None:
    """Mark the groups of the lattice over cells that changed since ``before``.

    ``before`` is an address; its cells are set to the present ones.
    """
    rows, groups = stale.shape
    now_groups = word_grid_at(log_odds[0], log_odds[1], log_odds[2] // _GROUP)
    old_groups = word_grid_at(before, log_odds[1], log_odds[2] // _GROUP)
    cosine, sine = lay[COSINE], lay[SINE]
    # Half the sides of the box around a turned group, and a cell to spare [cells].
    half_x, half_y = (
        0.5 * (_GROUP * abs(cosine) + abs(sine)) + 1.0,
        0.5 * (_GROUP * abs(sine) + abs(cosine)) + 1.0,
    )
    shift_x, shift_y = (
        (lay[START_X] - lay[CORNER_X]) / resolution,
        (lay[START_Y] - lay[CORNER_Y]) / resolution,
    )
    for row in range(max(span[2], 0), min(span[3], log_odds[1])):
        for group in range(max(span[0] // _GROUP, 0), min(span[1] // _GROUP + 1, log_odds[2] // _GROUP)):
            if now_groups[row, group] == old_groups[row, group]:
                continue
            old_groups[row, group] = now_groups[row, group]
            x, y = lay[ORIGIN_X] / resolution + (group + 0.5) * _GROUP, lay[ORIGIN_Y] / resolution + row + 0.5
            east, north = cosine * x - sine * y + shift_x, sine * x + cosine * y + shift_y
            first, end = (
                max(int(math.floor(east - half_x)) // _GROUP, 0),
                min(int(math.floor(east + half_x)) // _GROUP + 1, groups),
            )
            for i in range(
                max(int(math.floor(north - half_y)), 0), min(int(math.floor(north + half_y)) + 1, rows)
            ):
                for over in range(first, end):
                    stale[i, over] = np.uint8(255)


@kernel
def _add_overlaid_group(
    log_odds: Array, lay: Array, resolution: float, row: int, first: int, total: Array
) -> None:
    """Add the cells of a rotated map that lie below a group of the lattice.

    A cell counts where it lies below the centre of a lattice cell, from column ``first`` on.
    """
    cosine, sine = lay[COSINE], lay[SINE]
    north = (row + 0.5) * resolution + lay[CORNER_Y] - lay[START_Y]
    for k in range(_GROUP):
        east = (first + k + 0.5) * resolution + lay[CORNER_X] - lay[START_X]
        own_column = int(math.floor((cosine * east + sine * north - lay[ORIGIN_X]) / resolution))
        own_row = int(math.floor((cosine * north - sine * east - lay[ORIGIN_Y]) / resolution))
        if 0 <= own_row < log_odds[1] and 0 <= own_column < log_odds[2]:
            total[k] = np.int16(
                total[k] + np.int16(int8_at(log_odds[0] + own_row * log_odds[2] + own_column, 1)[0])
            )


@kernel
def note_overlaid_changes(
    laid: LaidMaps,
    poses: Array,
    last: Array,
    reach: float,
    known: Array,
    occupied: Array,
    changes: Array,
) -> int:
    """Update the planes of a team's map from maps in frames of their own starts.

    As ``note_changes``, but each robot's map is in the frame of its own start.

    Parameters
    ----------
    laid : LaidMaps
        The robots' maps.
    poses, last : (robots, 2 or more), (robots, 2) float64
        Where each robot is in the frame of its start, and where it was at the last look (updated) [m].
    reach, known, occupied, changes
        As for ``note_changes``.

    Returns
    -------
    int
        Number of changed words.
    """
    rows, words = known.shape
    maps, before, lays, resolution = laid
    stale = np.zeros((rows, words * (64 // _GROUP)), np.uint8)
    frame = np.empty(3)
    for robot in range(maps.shape[0]):
        frame[0], frame[1], frame[2] = lays[robot, ORIGIN_X], lays[robot, ORIGIN_Y], resolution
        span = _spans(poses[robot : robot + 1], last[robot : robot + 1], reach, frame)[0]
        _mark_stale(maps[robot], before[robot], lays[robot], resolution, span, stale)
    marks = word_grid_at(stale.ctypes.data, rows, words)
    sums = np.empty(64, np.int16)
    found = 0
    for row in range(rows):
        for word in range(words):
            # A byte of 255 for each group of 8 cells: the same as their bits.
            where = marks[row, word]
            if where == np.uint64(0):
                continue
            for group in range(64 // _GROUP):
                if stale[row, word * (64 // _GROUP) + group]:
                    part = sums[group * _GROUP : (group + 1) * _GROUP]
                    part[:] = np.int16(0)
                    for robot in range(maps.shape[0]):
                        _add_overlaid_group(
                            maps[robot], lays[robot], resolution, row, word * 64 + group * _GROUP, part
                        )
            if _note_word(sums.ctypes.data, where, row, word, known, occupied, changes[found]):
                found += 1
    return found


def levels_of_planes(known: NDArray[np.uint64], occupied: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Return the three-level map of two planes (rows, words).

    Levels: 0 occupied, 127 unknown, 255 free, shape (rows, words * 64).
    """
    rows, words = known.shape
    is_known, is_occupied = (
        np.unpackbits(np.ascontiguousarray(plane, "<u8").view(np.uint8), bitorder="little").reshape(
            rows, words * WORD
        )
        for plane in (known, occupied)
    )
    return np.asarray(np.array([UNKNOWN, FREE, UNKNOWN, OCCUPIED], np.uint8)[is_known + 2 * is_occupied])
