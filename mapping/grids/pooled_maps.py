"""Maps whose cells hold the maximum log-odds of a square of cells.

They are kept next to a map and recomputed only in areas that have changed. Bits mark these: one for each
word of 64 cells in which a level has changed, and one for each row with such words, after the last row, so
that unchanged rows are not even read.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.scan_integration import WORD
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.cells import max_of_groups
from lidarium.mapping.kernels.simd.words import first_bit
from lidarium.mapping.kernels.views import scratch_vector, vector_at

POOL, POOL_ROWS, POOL_COLUMNS = range(3)
"""Columns of a table of pooled maps: address, rows, columns."""


@kernel(forceinline=True)
def touched_words(columns: int) -> int:
    """Return the number of words that hold a bit for each word of 64 cells of a row of a map."""
    return (columns + WORD * WORD - 1) // (WORD * WORD)


def untouched(rows: int, columns: int) -> NDArray[np.uint64]:
    """Return the change bits of an unchanged map: (rows + rows / 64, ``touched_words``); none for no rows."""
    return np.zeros((rows + -(-rows // WORD), touched_words(columns)), np.uint64)


def touch(touched: NDArray[np.uint64], rows: tuple[int, int], words: tuple[int, int]) -> None:
    """Mark a map as changed in rows (low, high), and in words of 64 cells of them (low, high)."""
    of_rows = len(touched) - -(-len(touched) // (WORD + 1))
    for word in range(*words):
        touched[rows[0] : rows[1], word // WORD] |= np.uint64(1 << word % WORD)
    for row in range(*rows):
        touched[of_rows + row // WORD, 0] |= np.uint64(1 << row % WORD)


@kernel(nrt=False)
def pool_touched(log_odds: Array, touched: Array, scale: int, pooled: Array) -> None:
    """Update a pooled map in the areas in which levels of the map have changed.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map; columns a multiple of 64.
    touched : (rows + rows / 64, touched_words) uint64
        Bits of the words of 64 cells in which a level has changed, and of their rows, see ``untouched``.
    scale : int
        Side of a pooled cell [cells of the map].
    """
    rows, maxima = log_odds.shape[0], scratch_vector(WORD, np.int8)
    for group in range(rows, touched.shape[0]):
        left = touched[group, 0]
        while left != np.uint64(0):
            row = (group - rows) * WORD + first_bit(left)
            # The rows of one row of pooled cells are pooled together, as far as this word of rows goes.
            end = min((row // scale + 1) * scale, (group - rows + 1) * WORD)
            for index in range(touched.shape[1]):
                words = np.uint64(0)
                for other in range(row, min(end, rows)):
                    words |= touched[other, index]
                while words != np.uint64(0):
                    _pool_word(log_odds, row // scale, index * WORD + first_bit(words), scale, maxima, pooled)
                    words &= words - np.uint64(1)
            left = left >> np.uint64(end & 63) << np.uint64(end & 63) if end & 63 else np.uint64(0)


@kernel(nrt=False)
def forget_touched(touched: Array, rows: int) -> None:
    """Clear the change bits of a map with a number of rows."""
    for group in range(rows, touched.shape[0]):
        left = touched[group, 0]
        touched[group, 0] = np.uint64(0)
        while left != np.uint64(0):
            touched[(group - rows) * WORD + first_bit(left), :] = np.uint64(0)
            left &= left - np.uint64(1)


@kernel(forceinline=True, nrt=False)
def _pool_word(log_odds: Array, row: int, word: int, scale: int, maxima: Array, pooled: Array) -> None:
    """Write the pooled cells of a word of 64 cells in a row of pooled cells.

    ``maxima`` (64,) int8 is scratch.
    """
    rows, columns = log_odds.shape
    if scale in (2, 4, 8, 16):
        width, halvings = WORD // scale, 0
        while (1 << halvings) < scale:
            halvings += 1
        first_row, count = row * scale, min(scale, rows - row * scale)
        source, target = (
            log_odds.ctypes.data + first_row * columns + word * WORD,
            pooled.ctypes.data + row * pooled.shape[1] + word * width,
        )
        max_of_groups(source, columns, count, -128 if count == scale else 0, halvings, maxima.ctypes.data)
        for index in range(0, width, 4):
            vector_at(target + index, 1, np.uint32)[0] = vector_at(maxima.ctypes.data + index, 1, np.uint32)[0]
        return
    for column in range(word * WORD // scale, min(((word + 1) * WORD - 1) // scale + 1, pooled.shape[1])):
        pooled[row, column] = _max_of_square(log_odds, row * scale, column * scale, scale)


@kernel(forceinline=True, nrt=False)
def _max_of_square(log_odds: Array, first_row: int, first_column: int, scale: int) -> np.int8:
    """Return the maximum log-odds of a square of cells; cells beyond the map are 0."""
    last_row, last_column = (
        min(first_row + scale, log_odds.shape[0]),
        min(first_column + scale, log_odds.shape[1]),
    )
    is_whole = last_row == first_row + scale and last_column == first_column + scale
    maxima = np.int8(-128) if is_whole else np.int8(0)
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            maxima = max(maxima, log_odds[row, column])
    return maxima
