"""Edges of cells at which two regions meet."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel

NONE = -1
"""Label of cells that are in no region."""


class Meetings(NamedTuple):
    """Edges between cells of two regions.

    Attributes
    ----------
    regions : (n, 2) int32
        The regions.
    clearance : (n,) float32
        Of the narrower of both cells [cells].
    places : (n, 2) float64
        Middle of each edge, column and row [cells].
    steps : (n, 2) float64
        Unit step across it, from the first region to the second.
    """

    regions: NDArray[np.int32]
    clearance: NDArray[np.float32]
    places: NDArray[np.float64]
    steps: NDArray[np.float64]


def find_meetings(labels: NDArray[np.int32], clearance: NDArray[np.float32]) -> Meetings:
    """Return all edges at which cells of two regions meet.

    Parameters
    ----------
    labels : (rows, columns) int32
        Region of each cell, or `NONE`.
    clearance : (rows, columns) float32
        Distance to what is not free [cells].
    """
    cells = np.empty((_count(labels), 3), np.int64)
    _collect(labels, cells)
    row, column, is_down = cells.T
    beside = row + is_down, column + 1 - is_down
    steps = np.column_stack([1 - is_down, is_down]).astype(np.float64)
    return Meetings(
        np.column_stack([labels[row, column], labels[beside]]),
        np.minimum(clearance[row, column], clearance[beside]),
        np.column_stack([column, row]) + 0.5 + 0.5 * steps,
        steps,
    )


@kernel
def _count(labels: Array) -> int:
    """Return the number of edges at which two regions meet."""
    count = 0
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            for down in range(2):
                if _meets(labels, row, column, down, 1 - down):
                    count += 1
    return count


@kernel
def _collect(labels: Array, cells: Array) -> None:
    """Write the first cell of each edge, and whether the other is below: 1, else 0."""
    count = 0
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            for down in range(2):
                if _meets(labels, row, column, down, 1 - down):
                    cells[count, 0], cells[count, 1], cells[count, 2] = row, column, down
                    count += 1


@kernel(forceinline=True)
def _meets(labels: Array, row: int, column: int, down: int, right: int) -> bool:
    """Whether a cell and that beside it are of two regions."""
    if labels[row, column] == NONE or row + down >= labels.shape[0] or column + right >= labels.shape[1]:
        return False
    other = labels[row + down, column + right]
    return bool(other != NONE and other != labels[row, column])
