"""The three-level map of a team as two bits per cell, and what changes in it.

A cell is free where the sum of the robots' log-odds is below 0, occupied where it is above, and else unknown.
Two planes of bits hold which cells are known and which are occupied, one word for 64 cells of a row; what
changed is given by words: which one, and which of its bits flipped. So a wall that noise moves to and fro
flips bits of one plane only. Only what the robots can have seen since the last call is compared again.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.grids.scan_integration import WORD
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.cells import sign_bits
from lidarium.mapping.kernels.views import vector_at

_ALL = np.uint64(2**64 - 1)


@kernel
def seen_spans(poses: Array, last: Array, reach: float, frame: Array) -> Array:
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
def note_word(
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
    """Update the planes of a team's map where its robots' maps may have changed.

    All robots' maps are on one lattice.

    Parameters
    ----------
    maps : (robots, 3 or more) int64
        Address of each robot's log-odds (int8) at the lattice's first cell, and rows and columns of its map,
        which may be larger.
    poses, last : (robots, 2 or more), (robots, 2) float64
        Where the robots are, and where they were at the last call (updated) [m].
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
            if note_word(
                sums.ctypes.data + (word - low) * 128, _ALL, row, word, known, occupied, changes[found]
            ):
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


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Return a name that has moved; it warns."""
    from lidarium.moved import moved_name

    return moved_name(__name__, name)
