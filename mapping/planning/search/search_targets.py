"""Targets of a search: cells of a mask near the body.

Each is within a disc around where the body stands.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.planning.search.search_state import TILE_SHIFT


@dataclass(frozen=True, slots=True)
class Targets:
    """Target cells of a search.

    The search ends once it can see one of them within reach.

    Attributes
    ----------
    mask : (rows, columns) uint8
        1 in the cells that are searched; other values are ignored.
    near : (ceil(rows / 16), ceil(columns / 16)) uint8
        Not 0 in tiles from which a cell of the mask may be within reach.
    spans : (2 k + 1,) int64
        The disc of ``reach`` around a cell: in row i - k from the cell the columns up to ``spans[i]`` on
        either side.
    """

    mask: NDArray[np.uint8]
    near: NDArray[np.uint8]
    spans: NDArray[np.int64]

    @classmethod
    def of(cls, mask: NDArray[np.bool_] | NDArray[np.uint8], reach: float = 0.0) -> "Targets":
        """Look for the cells of a mask (rows, columns), from up to ``reach`` cells away."""
        cells = np.ascontiguousarray(mask, dtype=np.uint8)
        size = 1 << TILE_SHIFT
        rows, columns = (np.arange(0, side, size) for side in cells.shape)
        counts = np.add.reduceat(
            np.add.reduceat((cells == 1).astype(np.int32), rows, axis=0), columns, axis=1
        )
        return cls(cells, near_tiles(counts, reach), disc_spans(reach))

    @classmethod
    def at(cls, cells: Iterable[tuple[int, int]], shape: tuple[int, ...]) -> "Targets":
        """Look for some cells (row, column) of a grid, from these cells themselves."""
        size = 1 << TILE_SHIFT
        mask, near = np.zeros(shape, np.uint8), np.zeros([-(-side // size) for side in shape], np.uint8)
        for row, column in cells:
            mask[row, column] = near[row >> TILE_SHIFT, column >> TILE_SHIFT] = 1
        return cls(mask, near, disc_spans(0.0))


@lru_cache(maxsize=64)
def disc_spans(reach: float) -> NDArray[np.int64]:
    """Return half widths of the rows of a disc of ``reach`` cells.

    Around the centre of a cell.
    """
    squared = reach * reach + 1e-9
    steps = np.arange(-math.floor(math.sqrt(squared)), math.floor(math.sqrt(squared)) + 1)
    spans: NDArray[np.int64] = np.floor(np.sqrt(squared - steps * steps)).astype(np.int64)
    spans.flags.writeable = False
    return spans


def near_tiles(counts: NDArray[np.int32], reach: float) -> NDArray[np.uint8]:
    """Return the tiles within ``reach`` cells of a cell counted in ``counts``.

    Some cell of the tile may be that near; ``counts`` has one number per tile.
    """
    return np.asarray(_grown(counts, math.ceil(reach / (1 << TILE_SHIFT))))


@kernel
def _grown(counts: NDArray[np.int32], margin: int) -> NDArray[np.uint8]:
    rows, columns = counts.shape
    near = np.zeros((rows, columns), np.uint8)
    for row in range(rows):
        for column in range(columns):
            if counts[row, column] > 0:
                near[
                    max(row - margin, 0) : row + margin + 1, max(column - margin, 0) : column + margin + 1
                ] = 1
    return near
