"""The maps that robots begin with: blank, and large enough for the floor."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.kernels.floor_tables import FloorTables
from lidarium.mapping.grids.pooled_maps import touch
from lidarium.mapping.grids.scan_integration import WORD
from lidarium.mapping.kernels.huge_pages import ArrayPool

LEAST_MARGIN = 8.0
"""Maps of robots whose poses drift reach at least this far beyond the floor [m]."""

Map = tuple[NDArray[np.int8], tuple[float, float]]
"""Log-odds (rows, columns), and where cell (0, 0) begins [m]."""


def map_around_start(pages: ArrayPool, floor: FloorTables, resolution: float) -> Map:
    """Return a map in the start's own frame that holds the whole floor.

    It does so however the floor is turned.
    """
    rows, columns = floor.laser.solid.shape
    # A square around the start, in steps of 32 m: its size and place show nothing of the floor's shape.
    diagonal = math.hypot(rows, columns) * floor.laser.resolution
    half = math.ceil(math.ceil(diagonal / 32.0) * 32.0 / resolution / WORD) * WORD
    return pages.blank((2 * half, 2 * half), np.int8), (-half * resolution, -half * resolution)


def map_with_margin(pages: ArrayPool, floor: FloorTables, rows: int, columns: int, resolution: float) -> Map:
    """Return a map on the floor's lattice that reaches beyond the floor.

    It has ``rows`` x ``columns`` cells, for poses that drift.
    """
    margin = (
        math.ceil(max(LEAST_MARGIN, 0.5 * math.hypot(rows, columns) * resolution) / resolution / WORD) * WORD
    )
    x, y = floor.laser.origin
    return pages.blank((rows + 2 * margin, columns + 2 * margin), np.int8), (
        x - margin * resolution,
        y - margin * resolution,
    )


def wipe(log_odds: NDArray[np.int8], touched: NDArray[np.uint64], window: NDArray[np.int64]) -> None:
    """Make a map blank again, and note where it was not.

    This is noted in ``touched`` and in the ``window`` of changes (4,).
    """
    used = (log_odds.view(np.uint64) != 0).reshape(len(log_odds), -1, WORD // 8).any(axis=2)
    lines, words = np.flatnonzero(used.any(axis=1)), np.flatnonzero(used.any(axis=0))
    if not lines.size:
        return
    log_odds[lines[0] : lines[-1] + 1] = 0
    first, end = int(words[0]), int(words[-1]) + 1
    _note(touched, window, (int(lines[0]), int(lines[-1]) + 1), (first, end), (WORD * first, WORD * end))


def blank(
    log_odds: NDArray[np.int8],
    where: NDArray[np.bool_],
    corner: tuple[int, int],
    touched: NDArray[np.uint64],
    window: NDArray[np.int64],
) -> None:
    """Make the cells of a mask unknown, and note that as `wipe` does.

    The first cell of the mask lies at ``corner`` (row, column).
    """
    rows, columns = (
        np.flatnonzero(where.any(axis=axis)) + first for axis, first in zip((1, 0), corner, strict=True)
    )
    if not rows.size:
        return
    log_odds[corner[0] : corner[0] + where.shape[0], corner[1] : corner[1] + where.shape[1]][where] = 0
    words = (int(columns[0]) // WORD, int(columns[-1]) // WORD + 1)
    _note(touched, window, (int(rows[0]), int(rows[-1]) + 1), words, (int(columns[0]), int(columns[-1]) + 1))


def _note(
    touched: NDArray[np.uint64],
    window: NDArray[np.int64],
    rows: tuple[int, int],
    words: tuple[int, int],
    columns: tuple[int, int],
) -> None:
    """Note that a map has changed in rows and columns (low, high).

    The words of 64 cells of these rows that changed are noted as well.
    """
    if touched.size:
        touch(touched, rows, words)
    window[0], window[1] = min(window[0], rows[0]), max(window[1], rows[1])
    window[2], window[3] = min(window[2], columns[0]), max(window[3], columns[1])
