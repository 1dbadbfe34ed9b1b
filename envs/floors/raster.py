"""Grids of solid cells, and how they lie on a floor."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """The cells of a grid, row after row, as runs of equal ones.

    Attributes
    ----------
    values : (runs,) array
        Value of the cells of each run; of the grid's type.
    lengths : (runs,) int32
        Number of cells of each run.
    shape : (rows, columns)
        Shape of the grid.
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
        """Memory of the runs [bytes]."""
        return self.values.nbytes + self.lengths.nbytes


# Origins of rasters are whole multiples of this [m], so that belief grids of every usual resolution line up
# with them.
LATTICE = 0.1
_PADDING = 8


@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """Solid cells of a floor at one height.

    Attributes
    ----------
    solid : (rows, columns) uint8
        1 if the cell is solid; row 0 at the lowest y. The outermost ring of cells is solid.
    origin : (x, y)
        Lower left corner of cell (0, 0) [m].
    resolution : float
        Side of a cell [m].
    kept : dict of Runs
        Results that were computed from the cells if they are read-only, see ``free_space``.
    """

    solid: NDArray[np.uint8]
    origin: tuple[float, float]
    resolution: float
    kept: dict[tuple[Any, ...], Runs] = field(default_factory=dict, init=False, repr=False)

    @property
    def nbytes(self) -> int:
        """Memory of the cells and of the results kept with them [bytes]."""
        return self.solid.nbytes + sum(runs.nbytes for runs in list(self.kept.values()))


def frame_of(
    bounds: tuple[float, float, float, float], resolution: float
) -> tuple[tuple[float, float], tuple[int, int]]:
    """Return origin and (rows, columns) of the raster.

    It has at least one cell beyond the bounds on all sides.
    """
    margin = math.ceil(resolution / LATTICE - 1e-9)
    # Divided, not multiplied: 3 / 10 is the double nearest to 0.3, and 3 * 0.1 is not.
    x, y = ((math.floor(low / LATTICE + 1e-9) - margin) / round(1.0 / LATTICE) for low in bounds[:2])
    columns, rows = (math.ceil((high - low) / resolution - 1e-9) + 1 for low, high in ((x, bounds[2]), (y, bounds[3])))
    return (x, y), (-(-rows // _PADDING) * _PADDING, -(-columns // _PADDING) * _PADDING)


def cells_within(
    bounds: tuple[float, float, float, float], origin: tuple[float, float], resolution: float
) -> tuple[slice, slice]:
    """Return rows and columns of the cells whose centre is within the bounds."""
    x_low, y_low, x_high, y_high = ((bounds[k] - origin[k % 2]) / resolution - 0.5 for k in range(4))
    return (
        slice(math.ceil(y_low - 1e-6), math.floor(y_high + 1e-6) + 1),
        slice(math.ceil(x_low - 1e-6), math.floor(x_high + 1e-6) + 1),
    )


def sampled(
    cells: Raster, origin: tuple[float, float], resolution: float, inside: tuple[slice, slice]
) -> NDArray[np.uint8]:
    """Return the image cell under each cell centre; solid outside of the image."""
    indices = []
    for axis in (0, 1):
        centres = origin[1 - axis] + (np.arange(inside[axis].start, inside[axis].stop) + 0.5) * resolution
        indices.append(np.floor((centres - cells.origin[1 - axis]) / cells.resolution + 1e-6).astype(np.int64))
    framed = np.pad((cells.solid != 0).astype(np.uint8), 1, constant_values=1)
    rows, columns = (np.clip(index + 1, 0, framed.shape[axis] - 1) for axis, index in enumerate(indices))
    return np.take(framed[rows], columns, axis=1)


def rectangles_of(solid: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return rectangles that cover the cells of a grid, each once.

    Parameters
    ----------
    solid : (rows, columns) bool
        The cells.

    Returns
    -------
    (N, 4) int64
        First row, first column, row and column behind the last: runs of a row, joined with equal runs below.
    """
    edges = np.diff(np.pad(solid, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, firsts = np.nonzero(edges > 0)
    lasts = np.nonzero(edges < 0)[1]
    found: list[tuple[int, int, int, int]] = []
    begun: dict[tuple[int, int], int] = {}
    runs = list(zip(rows.tolist(), firsts.tolist(), lasts.tolist(), strict=True))
    place = 0
    for row in range(len(solid) + 1):
        here: dict[tuple[int, int], int] = {}
        while place < len(runs) and runs[place][0] == row:
            run = runs[place][1:]
            here[run] = begun.pop(run, row)
            place += 1
        found += [(first_row, first, row, last) for (first, last), first_row in begun.items()]
        begun = here
    return np.array(found, np.int64).reshape(-1, 4)
