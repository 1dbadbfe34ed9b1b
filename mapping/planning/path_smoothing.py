"""Short cuts in a path of cells, which reduce it to few waypoints joined by straight lines.

A straight line may replace a piece of a path if every cell it crosses is known to be free and its exact
distance to all occupied squares is at least that of the replaced piece, or the preferred one. Lines are
first tested through the clearance of the cells along their middle; only if that leaves doubt, occupied
squares nearby are measured one by one.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.grid_lines import line_is_free
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.search.search_state import Terrain

STEP = 0.5
"""Distance between the points at which a line is tested [cells]."""

PIECES_AT_ONCE = 10
"""Number of such pieces that are measured together if there is doubt."""

HALF_DIAGONAL = 0.7072
"""Distance from the centre of a square to its corners, rounded up [cells]."""

LOSS_OF_DIAGONALS = 2.0
"""Maximum squared clearance lost on a diagonal step [half cells squared]."""

ROUNDING = 1e-9
"""Distances that differ by less than this count as the same [cells]."""


@kernel
def kept_places(path: Array, terrain: Terrain) -> NDArray[np.int64]:
    """Return the indices of the cells of a path that short cuts keep (kernel).

    From each kept cell it goes as far as a line can: it halves the distance until a line fits, then walks on while
    one does.
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


@kernel(nrt=False)
def _nearest_on(path: Array, first: int, end: int, closeness: Array) -> int:
    """Return the maximum closeness of the cells of a piece of a path."""
    nearest = 0
    for i in range(first, end):
        nearest = max(nearest, int(closeness[path[i, 0], path[i, 1]]))
    return nearest


@kernel(nrt=False)
def _can_replace(path: Array, first: int, last: int, nearest: int, terrain: Terrain) -> bool:
    """Whether a straight line between two cells of a path is as good as the piece that it replaces.

    ``nearest`` is the piece's maximum closeness.
    """
    passage, discs = terrain.passage, terrain.discs
    own = math.sqrt(max(passage.limit - nearest - LOSS_OF_DIAGONALS, 0.0)) * 0.5
    needed = max(passage.radius, min(passage.preferred, own))
    row, column, to_row, to_column = path[first, 0], path[first, 1], path[last, 0], path[last, 1]
    for k in range(len(discs)):
        if _distance_to_piece(discs[k, 0], discs[k, 1], row, column, to_row, to_column) < discs[k, 2]:
            return False
    return bool(
        line_is_clear(terrain.log_odds, terrain.closeness, passage.limit, row, column, to_row, to_column, needed)
    )


@kernel(nrt=False)
def _distance_to_piece(
    row: float, column: float, row_a: float, column_a: float, row_b: float, column_b: float
) -> float:
    """Return the distance from a point to the straight piece between a and b."""
    rise = row_b - row_a
    run = column_b - column_a
    squared = rise * rise + run * run
    part = 0.0
    if squared > 0.0:
        part = min(max(((row - row_a) * rise + (column - column_a) * run) / squared, 0.0), 1.0)
    return math.sqrt((row_a + part * rise - row) ** 2 + (column_a + part * run - column) ** 2)


@kernel(nrt=False)
def _distance_to_square(row: float, column: float, centre_row: int, centre_column: int) -> float:
    """Return the distance from a point to the square of a cell."""
    return math.sqrt(max(abs(row - centre_row) - 0.5, 0.0) ** 2 + max(abs(column - centre_column) - 0.5, 0.0) ** 2)


@kernel(nrt=False)
def _piece_is_clear(
    log_odds: Array, row_a: float, column_a: float, row_b: float, column_b: float, needed: float
) -> bool:
    """Whether a piece of a line keeps ``needed`` cells from occupied squares.

    It crosses free cells only.
    """
    rows, columns = log_odds.shape
    row_low = max(math.floor(min(row_a, row_b) - needed), 0)
    row_high = min(math.ceil(max(row_a, row_b) + needed) + 1, rows)
    column_low = max(math.floor(min(column_a, column_b) - needed), 0)
    column_high = min(math.ceil(max(column_a, column_b) + needed) + 1, columns)
    minimum = needed - ROUNDING
    for row in range(row_low, row_high):
        beliefs = log_odds[row, column_low:column_high]
        for i in range(beliefs.size):
            if beliefs[i] <= 0:
                continue
            column = column_low + i
            if _distance_to_piece(row, column, row_a, column_a, row_b, column_b) >= needed + HALF_DIAGONAL:
                continue
            if (
                _distance_to_square(row_a, column_a, row, column) < minimum
                or _distance_to_square(row_b, column_b, row, column) < minimum
            ):
                return False
            for up in (-0.5, 0.5):
                for right in (-0.5, 0.5):
                    if _distance_to_piece(row + up, column + right, row_a, column_a, row_b, column_b) < minimum:
                        return False
    return True


@kernel(nrt=False)
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
    """Whether a line between two cells is known free, ``needed`` cells from occupied ones (kernel)."""
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
            # Clearance falls by at most the distance: with spare clearance the next pieces are clear, too.
            i += 1 + int(spare / piece)
            continue
        end = min(i + PIECES_AT_ONCE, pieces)
        row_a, row_b = row + rise * i / pieces, row + rise * end / pieces
        column_a, column_b = column + run * i / pieces, column + run * end / pieces
        if not _piece_is_clear(log_odds, row_a, column_a, row_b, column_b, needed):
            return False
        i = end
    return True
