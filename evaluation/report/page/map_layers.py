"""Maps of an episode as the page shows them: cropped, coarse, and what changes from sample to sample."""

import functools
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.evaluation.report.page.packing import changed_runs

UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""Levels of a cell of the page."""

FINEST_M = 0.05
"""Least side of a cell of the page [m]."""

MOST_CELLS = 250_000
"""Most cells of a map of the page; where there were more, cells are made larger."""

_MARGIN_M = 0.15

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Grid:
    """Which part of a lattice the page shows, and how coarsely.

    Attributes
    ----------
    row, column : int
        First cell of the lattice.
    rows, columns : int
        Size in cells of the page.
    block : int
        Cells of the lattice along the side of a cell of the page.
    """

    row: int
    column: int
    rows: int
    columns: int
    block: int

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the lattice."""
        return (
            slice(self.row, self.row + self.rows * self.block),
            slice(self.column, self.column + self.columns * self.block),
        )

    def header(self, origin: tuple[float, float], resolution: float) -> dict[str, float]:
        """Return what the page has to know: size, lower left corner and side of a cell [m]."""
        return {
            "rows": self.rows,
            "columns": self.columns,
            "x": round(float(origin[0]) + self.column * resolution, 6),
            "y": round(float(origin[1]) + self.row * resolution, 6),
            "cell": round(self.block * resolution, 9),
        }


def grid_around(shown: Mask, resolution: float) -> Grid:
    """Return the grid that shows all cells of a lattice that are set, with a margin."""
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    if not len(rows):
        rows, columns = np.array([0]), np.array([0])
    margin = math.ceil(_MARGIN_M / resolution)
    sides = []
    for cells, size in ((rows, shown.shape[0]), (columns, shown.shape[1])):
        sides.append((max(int(cells[0]) - margin, 0), min(int(cells[-1]) + 1 + margin, size)))
    (row, end_row), (column, end_column) = sides
    area = (end_row - row) * (end_column - column)
    block = max(math.ceil(FINEST_M / resolution - 1e-9), math.ceil(math.sqrt(area / MOST_CELLS)))
    return Grid(row, column, max((end_row - row) // block, 1), max((end_column - column) // block, 1), block)


def coarse(occupied: Mask, free: Mask, block: int) -> NDArray[np.uint8]:
    """Return levels of blocks: occupied where any cell is, else free where any is, else unknown."""
    levels = occupied.view(np.uint8) * np.uint8(OCCUPIED)
    np.maximum(levels, free.view(np.uint8), out=levels)
    rows, columns = (side // block for side in levels.shape)
    # Rows first: they are whole and therefore quick, and leave fewer cells for the columns.
    for axis, size in ((0, rows), (1, columns)):
        parts = [levels.swapaxes(0, axis)[k : size * block : block] for k in range(block)]
        levels = functools.reduce(np.maximum, parts).swapaxes(0, axis)
    return np.ascontiguousarray(levels)


@dataclass(slots=True)
class Layer:
    """A map over time, as the changes from each sample to the next; it begins unknown.

    Attributes
    ----------
    levels : (rows, columns) uint8
        The map as of the last sample.
    changes : bytearray
        `changed_runs` of all samples.
    """

    levels: NDArray[np.uint8]
    changes: bytearray = field(default_factory=bytearray)

    @classmethod
    def blank(cls, grid: Grid) -> "Layer":
        """Return a layer of which nothing is known."""
        return cls(np.zeros((grid.rows, grid.columns), np.uint8))

    def add(self, levels: NDArray[np.uint8]) -> None:
        """Add a sample."""
        self.changes += changed_runs(self.levels, levels)
        self.levels = levels
