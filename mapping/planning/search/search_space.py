"""Memory of the searches over one grid, with what the last one found."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.planning.search.path_search import BUCKET_WIDTH, SPARE_CELLS
from lidarium.mapping.planning.search.search_state import (
    COLUMN_BITS,
    LEAVING,
    NO_ENTRY,
    ROW_SHIFT,
    STRAIGHT,
    clear,
    trace,
)

MOST_CELLS_A_SIDE = 2**15 - 1
"""Cells that a side of a grid may have: a row and a column fit into 32 bits."""


class SearchSpace:
    """Scratch memory of the searches over one grid.

    Each search forgets the one before.

    Parameters
    ----------
    shape : (rows, columns)
        Of the belief; at most 32,767 cells a side.
    resolution : float
        Side of a cell [m].
    """

    def __init__(self, shape: tuple[int, int], resolution: float) -> None:
        if not (0 < shape[0] <= MOST_CELLS_A_SIDE and 0 < shape[1] <= MOST_CELLS_A_SIDE):
            raise ValueError(f"shape is {tuple(shape)}; want 1 to {MOST_CELLS_A_SIDE} cells a side")
        if not resolution > 0.0:
            raise ValueError(f"resolution is {resolution} m; want a positive side of a cell")
        cells = shape[0] * shape[1]
        self.resolution = float(resolution)
        self.shape = (int(shape[0]), int(shape[1]))
        self.remaining: NDArray[np.int32] = np.zeros(shape, dtype=np.int32)
        self.parent: NDArray[np.uint8] = np.empty(shape, dtype=np.uint8)
        self.touched: NDArray[np.int32] = np.empty(cells + SPARE_CELLS, dtype=np.int32)
        self.hits: NDArray[np.int32] = np.empty(cells + SPARE_CELLS, dtype=np.int32)
        self.buckets: NDArray[np.int32] = np.empty((16, BUCKET_WIDTH), dtype=np.int32)
        self.touched_count = 0
        self.generation = 0

    def forget(self) -> None:
        """Clear what the last search left; its :class:`Search` can no longer be read."""
        clear(self.remaining, self.touched, self.touched_count)
        self.touched_count = 0
        self.generation += 1

    def provide(self, slots: int) -> None:
        """Have at least so many buckets, a power of two."""
        if slots > self.buckets.shape[0]:
            self.buckets = np.empty((slots, self.buckets.shape[1]), dtype=np.int32)

    @property
    def memory(self) -> NDArray[np.int64]:
        """Where the space lies, as a row of ``SearchMemory.table``."""
        arrays = (self.remaining, self.parent, self.touched, self.buckets)
        return np.array([*(array.ctypes.data for array in arrays), *self.buckets.shape], np.int64)


@dataclass(frozen=True, slots=True)
class Search:
    """What a search found; readable until the next search in the same space.

    Attributes
    ----------
    space : SearchSpace
        Where costs and parents lie.
    start : (row, column)
        Where it began.
    budget : int
        What could be spent, in units of cost.
    settled : int
        Costs up to this one [units] are final; a cell beyond counts as not reached.
    hits : (M, 2) int64
        The first targets (row, column), by cost and then by row and column; empty where none was searched
        or reached.
    """

    space: SearchSpace
    start: tuple[int, int]
    budget: int
    settled: int
    hits: NDArray[np.int64]
    generation: int

    @property
    def unit(self) -> float:
        """Metres of open floor that one unit of cost stands for."""
        return self.space.resolution / STRAIGHT

    def cost(self, cell: tuple[int, int]) -> float:
        """Cost [m] of the cheapest way to a cell, ``inf`` where it was not reached."""
        self._check()
        row, column = int(cell[0]), int(cell[1])
        if (row, column) == self.start:
            return 0.0
        left = int(self.space.remaining[row, column])
        if (
            left in (0, NO_ENTRY)
            or self.space.parent[row, column] >= LEAVING
            or self.budget - left > self.settled
        ):
            return math.inf
        return (self.budget - left) * self.unit

    def costs(self) -> NDArray[np.float64]:
        """Costs (rows, columns) [m] of all cells, ``inf`` where not reached.

        A pass over the whole grid: for tests and pictures.
        """
        self._check()
        left = self.space.remaining
        spent = self.budget - left.astype(np.int64)
        reached = (left > 0) & (left != NO_ENTRY) & (spent <= self.settled)
        reached[reached] = self.space.parent[reached] < LEAVING
        costs = np.where(reached, spent * self.unit, math.inf)
        costs[self.start] = 0.0
        return costs

    def reached(self) -> NDArray[np.int64]:
        """Cells (N, 2) that were reached, in the order in which they were first seen."""
        self._check()
        packed = self.space.touched[: self.space.touched_count].astype(np.int64)
        cells = np.stack((packed >> ROW_SHIFT, packed & COLUMN_BITS), axis=1)
        left = self.space.remaining[cells[:, 0], cells[:, 1]]
        passable = self.space.parent[cells[:, 0], cells[:, 1]] < LEAVING
        reached: NDArray[np.int64] = cells[
            (left != NO_ENTRY) & (self.budget - left <= self.settled) & passable
        ]
        return reached

    def path(self, cell: tuple[int, int]) -> NDArray[np.int64]:
        """Cheapest path to a cell.

        Returns
        -------
        (N, 2) int64
            Cells (row, column) from the start to ``cell``, both included; neighbours differ by at most one in
            each.

        Raises
        ------
        ValueError
            If the cell was not reached, or another search has used the space since.
        """
        if math.isinf(self.cost(cell)):
            raise ValueError(
                f"cell {(int(cell[0]), int(cell[1]))} was not reached from {self.start}; ask for its cost "
                "first"
            )
        return np.asarray(trace(self.space.parent, self.start[0], self.start[1], int(cell[0]), int(cell[1])))

    def _check(self) -> None:
        if self.generation != self.space.generation:
            raise ValueError(
                "another search has used this space since; read a search before the next one, or give it a "
                "space of its own"
            )
