"""Beliefs of the robots: their poses, their log-odds and the changed parts of these."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.mapping.grids.occupancy import OccupancySettings
from lidarium.mapping.grids.pooled_maps import touch, untouched
from lidarium.mapping.grids.scan_integration import WORD
from lidarium.mapping.kernels.huge_pages import ArrayPool

LEAST_MARGIN = 8.0
"""Minimum distance that maps of robots with drifting poses reach beyond the floor [m]."""

Map = tuple[NDArray[np.int8], tuple[float, float]]
"""Log-odds (rows, columns), and position of the corner of cell (0, 0) [m]."""


def _map_around_start(pages: ArrayPool, floor: FloorTables, resolution: float) -> Map:
    """Return a map in the start's own frame that holds the whole floor.

    It does so however the floor is turned.
    """
    rows, columns = floor.laser.solid.shape
    # A square around the start, in steps of 32 m: its size and place show nothing of the floor's shape.
    diagonal = math.hypot(rows, columns) * floor.laser.resolution
    half = math.ceil(math.ceil(diagonal / 32.0) * 32.0 / resolution / WORD) * WORD
    return pages.blank((2 * half, 2 * half), np.int8), (-half * resolution, -half * resolution)


def _map_with_margin(pages: ArrayPool, floor: FloorTables, rows: int, columns: int, resolution: float) -> Map:
    """Return a map on the floor's lattice that reaches beyond the floor.

    It has ``rows`` x ``columns`` cells, for poses that drift.
    """
    margin = math.ceil(max(LEAST_MARGIN, 0.5 * math.hypot(rows, columns) * resolution) / resolution / WORD) * WORD
    x, y = floor.laser.origin
    return pages.blank((rows + 2 * margin, columns + 2 * margin), np.int8), (
        x - margin * resolution,
        y - margin * resolution,
    )


def wipe(log_odds: NDArray[np.int8], touched: NDArray[np.uint64], window: NDArray[np.int64]) -> None:
    """Make a map blank again, and mark the cells that were not.

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
    rows, columns = (np.flatnonzero(where.any(axis=axis)) + first for axis, first in zip((1, 0), corner, strict=True))
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


class Beliefs:
    """Believed poses and maps of all episodes; row = episode * robots + robot.

    Parameters
    ----------
    rows : int
        Episodes x robots.
    robots : int
        Size of a team.
    occupancy : OccupancySettings
        Resolution and sensor model of the maps.
    scales : sequence of int
        Scales at which maps are pooled for observations [cells].
    is_true : bool
        Whether robots know their true poses, so that their maps have the floor's lattice and its size.
    scans_each_step : bool
        Whether robots scan in each step.

    Attributes
    ----------
    believed : (rows, 3) float64
        Poses as the localizers believe, in the floor's axes if starts are known [m, rad].
    scanned : (rows, 3) float64
        Believed poses at the last scans; ``believed`` itself if robots scan in each step [m, rad].
    log_odds : list of (map rows, map columns) int8
        The map of each robot.
    origins : (rows, 2) float64
        Position of the corner of cell (0, 0) of each map [m].
    windows : (rows, 4) int64
        Part of each map that has changed since ``forget_changes``: row_low, row_high, column_low, column_high.
    belief_rows : (rows, 5) int64
        Addresses of the maps (``maps`` of ``kernels.arrays``).
    pool_rows : (rows, scales, 3) int64
        Address, rows and columns of each robot's pooled maps.
    contact, heard : (rows, robots) uint8, (rows, robots * 3) float64
        Of which teammates a robot knows the pose although not all are known, and these poses [m, rad]; the
        radio writes them.
    renderings : (rows,) int64
        Number of times that each map was rendered again.
    """

    def __init__(
        self,
        rows: int,
        robots: int,
        occupancy: OccupancySettings,
        scales: Sequence[int],
        is_true: bool,
        scans_each_step: bool = True,
    ) -> None:
        self.occupancy, self.scales = occupancy, tuple(scales)
        self.increments, self._is_true = occupancy.increments, is_true
        self.believed, self.origins = np.zeros((rows, 3)), np.zeros((rows, 2))
        self.scanned = self.believed if scans_each_step else np.zeros((rows, 3))
        self.log_odds: list[NDArray[np.int8]] = [np.zeros((0, WORD), np.int8)] * rows
        self.windows, self.belief_rows = np.zeros((rows, 4), np.int64), np.zeros((rows, 5), np.int64)
        self.pool_rows = np.zeros((rows, len(self.scales), 3), np.int64)
        self.contact, self.heard = np.zeros((rows, robots), np.uint8), np.zeros((rows, 3 * robots))
        self.renderings = np.zeros(rows, np.int64)
        self._touched: list[NDArray[np.uint64]] = [untouched(0, WORD)] * rows
        self._pools: list[list[NDArray[np.int8]]] = [[] for _ in range(rows)]

    def place(
        self,
        row: int,
        floor: FloorTables,
        start: NDArray[np.float64] | None,
        shape: tuple[int, int],
        pages: ArrayPool,
    ) -> None:
        """Begin again with a blank map.

        Parameters
        ----------
        start : (3,) float64 or None
            Its start in the floor's frame; None if it does not know it.
        shape : (rows, columns)
            Size of the floor [map cells].
        """
        resolution = self.occupancy.resolution
        self.believed[row] = 0.0 if start is None else start
        if start is None:
            self.log_odds[row], self.origins[row] = _map_around_start(pages, floor, resolution)
        elif self._is_true:
            self.log_odds[row], self.origins[row] = pages.blank(shape, np.int8), floor.laser.origin
        else:
            self.log_odds[row], self.origins[row] = _map_with_margin(pages, floor, *shape, resolution)
        height, width = self.log_odds[row].shape
        # At scale 1 a map is its own pooled map.
        self._pools[row] = [
            pages.blank((-(-height // scale), -(-width // scale)), np.int8) if scale > 1 else self.log_odds[row]
            for scale in self.scales
        ]
        self._touched[row] = pages.blank(untouched(height if self.scales else 0, width).shape, np.uint64)
        self.contact[row], self.heard[row] = 0, 0.0

    def point_at(self, row: int) -> None:
        """Store the addresses of a robot's maps, for kernels."""
        log_odds, touched = self.log_odds[row], self._touched[row]
        self.belief_rows[row] = (log_odds.ctypes.data, *log_odds.shape, touched.ctypes.data, len(touched))
        for k, pooled in enumerate(self._pools[row]):
            self.pool_rows[row, k] = (pooled.ctypes.data, *pooled.shape)

    def wipe(self, row: int) -> None:
        """Make a robot's map blank again, to be rendered again."""
        wipe(self.log_odds[row], self._touched[row], self.windows[row])
        self.renderings[row] += 1

    def forget(self, row: int, where: NDArray[np.bool_], corner: tuple[int, int]) -> None:
        """Make cells of a robot's map unknown.

        They are those of a mask (rows, columns) whose first cell is that of ``corner`` (row, column).
        """
        blank(self.log_odds[row], where, corner, self._touched[row], self.windows[row])

    def forget_changes(self, first: int, last: int) -> None:
        """Begin again to note which part of the maps changes.

        This concerns rows ``first`` to ``last``.
        """
        for row in range(first, last):
            map_rows, map_columns = self.log_odds[row].shape
            self.windows[row] = (map_rows, 0, map_columns, 0)
