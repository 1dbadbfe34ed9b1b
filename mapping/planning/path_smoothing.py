"""Short cuts in a path of cells.

They reduce it to few waypoints, joined by straight lines that a body can drive.

A straight line may replace a piece of a path if every cell it crosses is known to be free and its exact
distance to all occupied squares is at least what the replaced piece has, though no more than is preferred.
Lines drawn through the middle of cells are tested through the clearance of those cells first; only where that
leaves doubt, occupied squares nearby are measured one by one.
"""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.grid_lines import line_is_free
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import Disc, centres_of
from lidarium.mapping.planning.search.search_state import Passage, Terrain

STEP = 0.5
"""Distance between the points at which a line is tested [cells]."""

PIECES_AT_ONCE = 10
"""Pieces of that length that are measured together where there is doubt."""

HALF_DIAGONAL = 0.7072
"""Distance from the centre of a square to its corners, rounded up [cells]."""

LOSS_OF_DIAGONALS = 2.0
"""Squared clearance lost on a diagonal step at most [half cells squared]."""

ROUNDING = 1e-9
"""Distances that differ by less than this count as the same [cells]."""

_NO_COSTS = np.zeros((2, 1), np.int32)
_NO_COSTS.flags.writeable = False


def shortened(
    path: NDArray[np.int64],
    log_odds: NDArray[np.int8],
    clearance: ClearanceField,
    footprint: Footprint,
    blocked: Iterable[Disc] = (),
) -> NDArray[np.int64]:
    """Few cells of a path such that straight lines between them can be driven.

    Parameters
    ----------
    path : (N, 2) int64
        Cells (row, column), each a neighbour of the one before.
    log_odds : (rows, columns) int8
        The belief.
    clearance : ClearanceField
        Clearance of the same belief.
    footprint : Footprint
        The body.
    blocked : iterable of (row, column, radius)
        Discs in cells that no new line may enter.

    Returns
    -------
    (M, 2) int64
        Cells of the path, the first and the last included.

    Raises
    ------
    ValueError
        If ``path`` is empty or not (N, 2).
    """
    cells = np.ascontiguousarray(path, dtype=np.int64)
    if cells.ndim != 2 or cells.shape[1] != 2 or len(cells) == 0:
        raise ValueError(f"path has shape {cells.shape}; want (N, 2) cells with N >= 1")
    resolution = clearance.resolution
    discs = np.array(list(blocked), dtype=np.float64).reshape(-1, 3)
    # What steps cost does not matter to short cuts.
    passage = Passage(
        clearance.limit, _NO_COSTS, 0, footprint.radius / resolution, footprint.preferred / resolution
    )
    kept = kept_places(cells, Terrain(log_odds, clearance.closeness, passage, discs))
    return np.asarray(cells[kept])


def waypoints(
    path: NDArray[np.int64],
    log_odds: NDArray[np.int8],
    clearance: ClearanceField,
    footprint: Footprint,
    origin: tuple[float, float] = (0.0, 0.0),
    blocked: Iterable[Disc] = (),
) -> NDArray[np.float64]:
    """Waypoints (M, 2) as (x, y) [m] of a path of cells.

    See :func:`shortened`. ``origin`` is the grid's lower left corner [m].
    """
    return centres_of(shortened(path, log_odds, clearance, footprint, blocked), origin, clearance.resolution)


def line_keeps_clearance(
    from_cell: tuple[int, int],
    to_cell: tuple[int, int],
    log_odds: NDArray[np.int8],
    clearance: ClearanceField,
    distance: float,
) -> bool:
    """Whether the line between two cells is known free and keeps ``distance`` [m].

    The line is straight between their centres; the distance is from occupied cells.
    """
    if distance > clearance.maximum:
        raise ValueError(f"distance is {distance} m; this field knows clearances up to {clearance.maximum} m")
    ends = np.array([from_cell, to_cell], dtype=np.int64)
    needed = distance / clearance.resolution
    return bool(
        line_is_clear(
            log_odds,
            clearance.closeness,
            clearance.limit,
            ends[0, 0],
            ends[0, 1],
            ends[1, 0],
            ends[1, 1],
            needed,
        )
    )


@kernel
def kept_places(path: Array, terrain: Terrain) -> NDArray[np.int64]:
    """Which cells of a path :func:`shortened` keeps (kernel).

    From each kept cell it goes as far as a line can: it halves the distance until a line fits, then walks on
    while one does.
    """
    count, closeness = len(path), terrain.closeness
    kept = np.zeros(count, np.int64)
    kept_count = 1
    anchor = 0
    while anchor < count - 1:
        ahead = count - 1 - anchor
        while ahead > 1:
            nearest = _nearest_on(path, anchor, anchor + ahead + 1, closeness)
            if _can_replace(path, anchor, anchor + ahead, nearest, terrain):
                break
            ahead //= 2
        ahead = max(ahead, 1)
        nearest = _nearest_on(path, anchor, anchor + ahead + 1, closeness)
        while anchor + ahead + 1 < count:
            nearest = max(nearest, _nearest_on(path, anchor + ahead + 1, anchor + ahead + 2, closeness))
            if not _can_replace(path, anchor, anchor + ahead + 1, nearest, terrain):
                break
            ahead += 1
        anchor += ahead
        kept[kept_count] = anchor
        kept_count += 1
    return kept[:kept_count]


@kernel
def _nearest_on(path: Array, first: int, end: int, closeness: Array) -> int:
    """Greatest closeness of the cells of a piece of a path."""
    nearest = 0
    for i in range(first, end):
        nearest = max(nearest, int(closeness[path[i, 0], path[i, 1]]))
    return nearest


@kernel
def _can_replace(path: Array, first: int, last: int, nearest: int, terrain: Terrain) -> bool:
    """Whether a straight line is as good as the piece of a path it replaces.

    It joins two cells of the path. The piece's greatest closeness is ``nearest``.
    """
    passage, discs = terrain.passage, terrain.discs
    own = math.sqrt(max(passage.limit - nearest - LOSS_OF_DIAGONALS, 0.0)) * 0.5
    needed = max(passage.radius, min(passage.preferred, own))
    row, column, to_row, to_column = path[first, 0], path[first, 1], path[last, 0], path[last, 1]
    for k in range(len(discs)):
        if _distance_to_piece(discs[k, 0], discs[k, 1], row, column, to_row, to_column) < discs[k, 2]:
            return False
    return bool(
        line_is_clear(
            terrain.log_odds, terrain.closeness, passage.limit, row, column, to_row, to_column, needed
        )
    )


@kernel
def _distance_to_piece(
    row: float, column: float, row_a: float, column_a: float, row_b: float, column_b: float
) -> float:
    """Distance from a point to the straight piece between a and b."""
    rise = row_b - row_a
    run = column_b - column_a
    squared = rise * rise + run * run
    part = 0.0
    if squared > 0.0:
        part = min(max(((row - row_a) * rise + (column - column_a) * run) / squared, 0.0), 1.0)
    return math.sqrt((row_a + part * rise - row) ** 2 + (column_a + part * run - column) ** 2)


@kernel
def _distance_to_square(row: float, column: float, centre_row: int, centre_column: int) -> float:
    """Distance from a point to the square of a cell."""
    return math.sqrt(
        max(abs(row - centre_row) - 0.5, 0.0) ** 2 + max(abs(column - centre_column) - 0.5, 0.0) ** 2
    )


@kernel
def _piece_is_clear(
    log_odds: Array, row_a: float, column_a: float, row_b: float, column_b: float, needed: float
) -> bool:
    """Whether a piece of a line keeps ``needed`` cells from occupied squares.

    It crosses free cells only; every occupied square around it counts.
    """
    rows, columns = log_odds.shape
    row_low = max(math.floor(min(row_a, row_b) - needed), 0)
    row_high = min(math.ceil(max(row_a, row_b) + needed) + 1, rows)
    column_low = max(math.floor(min(column_a, column_b) - needed), 0)
    column_high = min(math.ceil(max(column_a, column_b) + needed) + 1, columns)
    least = needed - ROUNDING
    for row in range(row_low, row_high):
        beliefs = log_odds[row, column_low:column_high]
        for i in range(beliefs.size):
            if beliefs[i] <= 0:
                continue
            column = column_low + i
            if _distance_to_piece(row, column, row_a, column_a, row_b, column_b) >= needed + HALF_DIAGONAL:
                continue
            if (
                _distance_to_square(row_a, column_a, row, column) < least
                or _distance_to_square(row_b, column_b, row, column) < least
            ):
                return False
            for up in (-0.5, 0.5):
                for right in (-0.5, 0.5):
                    if _distance_to_piece(row + up, column + right, row_a, column_a, row_b, column_b) < least:
                        return False
    return True


@kernel
def line_is_clear(
    log_odds: Array,
    closeness: Array,
    limit: int,
    row: int,
    column: int,
    to_row: int,
    to_column: int,
    needed: float,
) -> bool:
    """Whether a line between two cells is free and keeps its clearance (kernel).

    It crosses only known free cells and keeps ``needed`` cells from all that is occupied.
    """
    if not line_is_free(log_odds, row, column, to_row, to_column):
        return False
    rise = float(to_row - row)
    run = float(to_column - column)
    length = math.sqrt(rise * rise + run * run)
    pieces = max(math.ceil(length / STEP), 1)
    piece = length / pieces + ROUNDING
    i = 0
    while i < pieces:
        middle_row, middle_column = row + rise * (i + 0.5) / pieces, column + run * (i + 0.5) / pieces
        cell_row, cell_column = math.floor(middle_row + 0.5), math.floor(middle_column + 0.5)
        offset = math.sqrt((middle_row - cell_row) ** 2 + (middle_column - cell_column) ** 2) + 0.5 * STEP
        spare = math.sqrt(float(limit - closeness[cell_row, cell_column])) * 0.5 - offset - needed
        if spare >= 0.0:
            # Clearance falls no faster than one walks: where there is room to spare the next pieces are clear
            # as well.
            i += 1 + int(spare / piece)
            continue
        end = min(i + PIECES_AT_ONCE, pieces)
        row_a, row_b = row + rise * i / pieces, row + rise * end / pieces
        column_a, column_b = column + run * i / pieces, column + run * end / pieces
        if not _piece_is_clear(log_odds, row_a, column_a, row_b, column_b, needed):
            return False
        i = end
    return True
