"""The explored area.

The score keeps a bit per robot and cell of the floor, at the resolution of the beliefs: the cells seen by
true beams from true poses, before noise. Of these only the cells of F count: those that the disc of the
smallest robot sweeps over its configuration space, connected to the starts.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.cells import prefetch
from lidarium.mapping.kernels.views import grid_at

ROWS_AHEAD = 24
"""Number of rows by which rows of a mask are prefetched from memory."""


def pack_bits(cells: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """Pack a (rows, columns) mask into (rows, words) uint64.

    Bit 0 of word 0 is at column 0.
    """
    rows, columns = cells.shape
    words = -(-columns // 64)
    padded = np.zeros((rows, words * 64), np.bool_)
    padded[:, :columns] = cells
    return np.packbits(padded, axis=1, bitorder="little").view("<u8").astype(np.uint64).copy()


def unpack_bits(bits: NDArray[np.uint64], columns: int) -> NDArray[np.bool_]:
    """Unpack (rows, words) uint64 into a (rows, columns) mask."""
    return np.unpackbits(bits.astype("<u8").view(np.uint8), axis=1, bitorder="little")[:, :columns].astype(np.bool_)


@kernel(forceinline=True)
def count_bits(value: np.uint64) -> int:
    """Count the set bits of a uint64."""
    value = value - ((value >> np.uint64(1)) & np.uint64(0x5555555555555555))
    value = (value & np.uint64(0x3333333333333333)) + ((value >> np.uint64(2)) & np.uint64(0x3333333333333333))
    value = (value + (value >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((value * np.uint64(0x0101010101010101)) >> np.uint64(56))


@kernel(nrt=False)
def mark_seen(
    own: Array,
    counted: Array,
    bits: Array,
    box: tuple[int, int, int, int],
    row_offset: int,
    word_offset: int,
    changes: Array,
) -> int:
    """Add a scan's seen cells to a robot's mask.

    Parameters
    ----------
    own, counted : (rows, words) uint64
        Area that the robot has seen (updated), and F.
    bits : (window rows, words) uint64
        The seen area.
    changes : (4,) int64
        Result: the part of the mask that holds the cells new to the robot (row_low, row_high, word_low,
        word_high).
    """
    rows, words = own.shape
    new = 0
    word_low, word_high = max(box[2], -word_offset), min(box[3], words - word_offset)
    row_low, row_high = rows, 0
    for row in range(max(box[0], -row_offset), min(box[1], rows - row_offset)):
        i = row + row_offset
        prefetch(own.ctypes.data + (i + ROWS_AHEAD) * words * 8)
        found = np.uint64(0)
        for word in range(word_low, word_high):
            j = word + word_offset
            value = bits[row, word] & counted[i, j] & ~own[i, j]
            if value != np.uint64(0):
                own[i, j] |= value
                new += count_bits(value)
                found |= value
        if found != np.uint64(0):
            row_low, row_high = min(row_low, i), i + 1
    changes[0], changes[1], changes[2], changes[3] = (
        row_low,
        row_high,
        word_low + word_offset,
        word_high + word_offset,
    )
    return new


@kernel(nrt=False)
def share_new_cells(owns: Array, team: Array, changes: Array, first: int, robots: int, gains: Array) -> int:
    """Credit each cell that is new to the team to the robots that saw it.

    Those that saw it in this step share it equally, in robot order.

    Cells in a robot's mask but not in the team's are those that the robot saw in this step.

    Parameters
    ----------
    owns : (maps,) int64
        Addresses of the robots' masks, of the shape of ``team``.
    team : (rows, words) uint64
        Area that the team has seen; updated.
    changes : (maps, 4) int64
        Windows in which ``mark_seen`` found cells that are new to each robot.
    gains : (maps,) float64
        Result: cells credited to each robot.
    """
    rows, words = team.shape
    total = 0
    for robot in range(first, first + robots):
        gain = 0.0
        own = grid_at(owns[robot], rows, words, np.uint64)
        for row in range(changes[robot, 0], changes[robot, 1]):
            for word in range(changes[robot, 2], changes[robot, 3]):
                value = own[row, word] & ~team[row, word]
                if value == np.uint64(0):
                    continue
                others = np.uint64(0)
                for other in range(first, first + robots):
                    if other != robot and changes[other, 0] < changes[other, 1]:
                        others |= grid_at(owns[other], rows, words, np.uint64)[row, word]
                gain += count_bits(value & ~others)
                value &= others
                while value != np.uint64(0):
                    bit = value & (~value + np.uint64(1))
                    value ^= bit
                    seen_by = 1
                    for other in range(first, first + robots):
                        if other != robot and grid_at(owns[other], rows, words, np.uint64)[row, word] & bit:
                            seen_by += 1
                    gain += 1.0 / seen_by
        gains[robot] = gain
    for robot in range(first, first + robots):
        own = grid_at(owns[robot], rows, words, np.uint64)
        for row in range(changes[robot, 0], changes[robot, 1]):
            for word in range(changes[robot, 2], changes[robot, 3]):
                value = own[row, word] & ~team[row, word]
                total += count_bits(value)
                team[row, word] |= value
    return total
