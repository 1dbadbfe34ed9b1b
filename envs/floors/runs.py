"""Grids of few values kept as runs of equal cells.

What is kept of a floor is some 17 times smaller so, and is unpacked in the time that its cells take to write.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """The cells of a grid, row after row, as runs of equal ones.

    Attributes
    ----------
    values : (runs,) array
        What the cells of each run hold; of the grid's type.
    lengths : (runs,) int32
        How many they are.
    shape : (rows, columns)
        Of the grid.
    """

    values: NDArray[Any]
    lengths: NDArray[np.int32]
    shape: tuple[int, int]

    @classmethod
    def of(cls, grid: NDArray[Any]) -> "Runs":
        """Pack a grid (rows, columns)."""
        cells = grid.ravel()
        begins = np.concatenate([[0], np.flatnonzero(cells[1:] != cells[:-1]) + 1])
        lengths = np.diff(begins, append=cells.size).astype(np.int32)
        return cls(cells[begins], lengths, (grid.shape[0], grid.shape[1]))

    def grid(self) -> NDArray[Any]:
        """Unpack the grid, read-only."""
        grid = np.repeat(self.values, self.lengths).reshape(self.shape)
        grid.flags.writeable = False
        return grid

    def counts(self) -> NDArray[np.int64]:
        """Count the cells of each value, from 0 to the largest; values are whole numbers."""
        return np.bincount(self.values, weights=self.lengths).astype(np.int64)

    @property
    def nbytes(self) -> int:
        """How much memory the runs take."""
        return self.values.nbytes + self.lengths.nbytes
