"""The three-level map of a team as two bits per cell, and its changes.

A cell is free if the sum of the robots' log-odds is below 0, occupied if it is above, and unknown otherwise.
Two planes of bits hold which cells are known and which are occupied, one word for 64 cells of a row. A
change is the index of a word and its flipped bits, so a wall that noise moves to and fro flips bits of one
plane only. Only the area that the robots can have seen since the last call is compared again.

If the robots' maps are rotated, groups of cells that changed mark the lattice below them, and marked cells
are summed again.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.grids.scan_integration import WORD
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.cells import sign_bits
from lidarium.mapping.kernels.views import grid_at, vector_at

_ALL = np.uint64(2**64 - 1)


@kernel
def seen_spans(poses: Array, last: Array, reach: float, frame: Array) -> Array:
    """Return the cells that robots can have seen since ``last``, (robots, 4): columns and rows, low and high.

    ``last`` holds their earlier positions, and is updated. Columns and rows are in the grid of ``frame`` (3,), its
    corner and the side of a cell.
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
def note_word(sums: int, where: np.uint64, row: int, word: int, known: Array, occupied: Array, change: Array) -> bool:
    """Compare 64 int16 sums at an address with a word of the planes; return whether bits have flipped.

    Only the bits ``where`` are compared; flipped bits are written into ``change`` (3,).
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
    source = vector_at(address, total.size, np.int8)
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
    """Update the planes of a team's map around its robots; return the number of changed words.

    All robots' maps are on one lattice.

    Parameters
    ----------
    maps : (robots, 3 or more) int64
        Address of each robot's log-odds (int8) at the lattice's first cell, and rows and columns of its map,
        which may be larger.
    poses, last : (robots, 2 or more), (robots, 2) float64
        Positions of the robots, now and at the last call (updated) [m].
    reach : float
        Maximum distance at which a robot sees [m].
    frame : (3,) float64
        Lower left corner x, y and side of a cell of the lattice [m].
    known, occupied : (rows, words) uint64
        The planes; updated.
    changes : (rows * words, 3) uint64
        Result: index of each changed word (column of words * rows + row), its flipped bits in ``known`` and
        in ``occupied``.
    """
    rows, words = known.shape
    spans = seen_spans(poses, last, reach, frame)
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
            if note_word(sums.ctypes.data + (word - low) * 128, _ALL, row, word, known, occupied, changes[found]):
                found += 1
    return found


def levels_of_planes(known: NDArray[np.uint64], occupied: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Return the three-level map (rows, words * 64) of two planes (rows, words).

    Levels: 0 occupied, 127 unknown, 255 free.
    """
    rows, words = known.shape
    is_known, is_occupied = (
        np.unpackbits(np.ascontiguousarray(plane, "<u8").view(np.uint8), bitorder="little").reshape(rows, words * WORD)
        for plane in (known, occupied)
    )
    return np.asarray(np.array([UNKNOWN, FREE, UNKNOWN, OCCUPIED], np.uint8)[is_known + 2 * is_occupied])


_GROUP = 8
"""Cells of a rotated map compared, or lattice cells recomputed, at once: as many as a word has bytes."""

CORNER_X, CORNER_Y, START_X, START_Y, COSINE, SINE, ORIGIN_X, ORIGIN_Y = range(8)
"""Indices into the placement of a robot's map on the lattice.

The lattice's corner, the start and its heading, and the map's corner in the start's frame.
"""


class OverlaidMaps(NamedTuple):
    """Maps in frames of their robots' own starts, overlaid on a lattice.

    Attributes
    ----------
    maps : (robots, 3 or more) int64
        As for ``note_changes``; columns of the maps are a multiple of 8.
    before : (robots,) int64
        Addresses of the maps at the last call, blank at the first; updated.
    placements : (robots, 8) float64
        Placement of each map on the lattice: corner x, y of the lattice, start x, y, cosine and sine of the
        start's heading, and corner x, y of the map in the start's frame [m].
    resolution : float
        Side of a cell [m].
    """

    maps: NDArray[np.int64]
    before: NDArray[np.int64]
    placements: NDArray[np.float64]
    resolution: float


@kernel
def _mark_stale(log_odds: Array, before: int, placement: Array, resolution: float, span: Array, stale: Array) -> None:
    """Mark the groups of the lattice over cells that have changed since the map at address ``before``.

    That map is updated.
    """
    rows, groups = stale.shape
    now_groups = grid_at(log_odds[0], log_odds[1], log_odds[2] // _GROUP, np.uint64)
    old_groups = grid_at(before, log_odds[1], log_odds[2] // _GROUP, np.uint64)
    cosine, sine = placement[COSINE], placement[SINE]
    # Half the sides of the box around a turned group, and a cell to spare [cells].
    half_x, half_y = (
        0.5 * (_GROUP * abs(cosine) + abs(sine)) + 1.0,
        0.5 * (_GROUP * abs(sine) + abs(cosine)) + 1.0,
    )
    shift_x, shift_y = (
        (placement[START_X] - placement[CORNER_X]) / resolution,
        (placement[START_Y] - placement[CORNER_Y]) / resolution,
    )
    for row in range(max(span[2], 0), min(span[3], log_odds[1])):
        for group in range(max(span[0] // _GROUP, 0), min(span[1] // _GROUP + 1, log_odds[2] // _GROUP)):
            if now_groups[row, group] == old_groups[row, group]:
                continue
            old_groups[row, group] = now_groups[row, group]
            x, y = (
                placement[ORIGIN_X] / resolution + (group + 0.5) * _GROUP,
                placement[ORIGIN_Y] / resolution + row + 0.5,
            )
            east, north = cosine * x - sine * y + shift_x, sine * x + cosine * y + shift_y
            first, end = (
                max(int(math.floor(east - half_x)) // _GROUP, 0),
                min(int(math.floor(east + half_x)) // _GROUP + 1, groups),
            )
            for i in range(max(int(math.floor(north - half_y)), 0), min(int(math.floor(north + half_y)) + 1, rows)):
                for over in range(first, end):
                    stale[i, over] = np.uint8(255)


@kernel
def _add_overlaid_group(
    log_odds: Array, placement: Array, resolution: float, row: int, first: int, total: Array
) -> None:
    """Add the cells of a rotated map that lie below the centres of a group of lattice cells.

    The group begins at column ``first``.
    """
    cosine, sine = placement[COSINE], placement[SINE]
    north = (row + 0.5) * resolution + placement[CORNER_Y] - placement[START_Y]
    for k in range(_GROUP):
        east = (first + k + 0.5) * resolution + placement[CORNER_X] - placement[START_X]
        own_column = int(math.floor((cosine * east + sine * north - placement[ORIGIN_X]) / resolution))
        own_row = int(math.floor((cosine * north - sine * east - placement[ORIGIN_Y]) / resolution))
        if 0 <= own_row < log_odds[1] and 0 <= own_column < log_odds[2]:
            own = vector_at(log_odds[0] + own_row * log_odds[2] + own_column, 1, np.int8)[0]
            total[k] = np.int16(total[k] + np.int16(own))


@kernel
def note_overlaid_changes(
    overlaid: OverlaidMaps,
    poses: Array,
    last: Array,
    reach: float,
    known: Array,
    occupied: Array,
    changes: Array,
) -> int:
    """Do as ``note_changes`` with maps that are each in the frame of its robot's start.

    Parameters
    ----------
    poses, last : (robots, 2 or more), (robots, 2) float64
        Position of each robot in the frame of its start, now and at the last call (updated) [m].
    """
    rows, words = known.shape
    maps, before, placements, resolution = overlaid
    stale = np.zeros((rows, words * (64 // _GROUP)), np.uint8)
    frame = np.empty(3)
    for robot in range(maps.shape[0]):
        frame[0], frame[1], frame[2] = placements[robot, ORIGIN_X], placements[robot, ORIGIN_Y], resolution
        span = seen_spans(poses[robot : robot + 1], last[robot : robot + 1], reach, frame)[0]
        _mark_stale(maps[robot], before[robot], placements[robot], resolution, span, stale)
    marks = grid_at(stale.ctypes.data, rows, words, np.uint64)
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
                            maps[robot], placements[robot], resolution, row, word * 64 + group * _GROUP, part
                        )
            if note_word(sums.ctypes.data, where, row, word, known, occupied, changes[found]):
                found += 1
    return found
