"""Changes of a team's three-level map made of maps in frames of their own.

As in ``map_deltas``, but the maps are rotated: groups of cells that changed mark the lattice below them, and
what is marked is summed again.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.map_deltas import note_word, seen_spans
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at, vector_at

_GROUP = 8
"""Cells of a rotated map compared, or lattice cells recomputed, at once.

As many as bytes fit into a word.
"""

CORNER_X, CORNER_Y, START_X, START_Y, COSINE, SINE, ORIGIN_X, ORIGIN_Y = range(8)
"""Indices into the array that places a robot's map on the lattice.

The lattice's corner, the start and its heading, and the map's corner in the start's frame.
"""


class OverlaidMaps(NamedTuple):
    """Maps in frames of their robots' own starts, overlaid on a lattice.

    Attributes
    ----------
    maps : (robots, 3 or more) int64
        As for ``note_changes``; columns of the maps are a multiple of 8.
    before : (robots,) int64
        Addresses of the maps as they were at the last call, blank at the first; updated.
    placements : (robots, 8) float64
        How each map lies over the lattice: corner x, y of the lattice, start x, y, cosine and sine of the
        start's heading, and corner x, y of the map in the start's frame [m].
    resolution : float
        Side of a cell [m].
    """

    maps: NDArray[np.int64]
    before: NDArray[np.int64]
    placements: NDArray[np.float64]
    resolution: float


@kernel
def _mark_stale(
    log_odds: Array, before: int, placement: Array, resolution: float, span: Array, stale: Array
) -> None:
    """Mark the groups of the lattice over cells that changed since ``before``.

    ``before`` is an address; its cells are set to the present ones.
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
            for i in range(
                max(int(math.floor(north - half_y)), 0), min(int(math.floor(north + half_y)) + 1, rows)
            ):
                for over in range(first, end):
                    stale[i, over] = np.uint8(255)


@kernel
def _add_overlaid_group(
    log_odds: Array, placement: Array, resolution: float, row: int, first: int, total: Array
) -> None:
    """Add the cells of a rotated map that lie below a group of the lattice.

    A cell counts where it lies below the centre of a lattice cell, from column ``first`` on.
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
    """Update the planes of a team's map from maps in frames of their own starts.

    As ``note_changes``, but each robot's map is in the frame of its own start.

    Parameters
    ----------
    overlaid : OverlaidMaps
        The robots' maps.
    poses, last : (robots, 2 or more), (robots, 2) float64
        Where each robot is in the frame of its start, and where it was at the last call (updated) [m].
    reach, known, occupied, changes
        As for ``note_changes``.

    Returns
    -------
    int
        Number of changed words.
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
