"""What robots believe: their poses, their log-odds, what of these has changed."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.belief_maps import blank, map_around_start, map_with_margin, wipe
from lidarium.envs.simulation.kernels.floor_tables import FloorTables
from lidarium.mapping.grids.occupancy import OccupancySettings
from lidarium.mapping.grids.pooled_maps import untouched
from lidarium.mapping.grids.scan_integration import WORD
from lidarium.mapping.kernels.huge_pages import ArrayPool


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

    Attributes
    ----------
    believed : (rows, 3) float64
        Poses as the localizers believe, in the floor's axes where starts are known [m, rad].
    log_odds : list of (map rows, map columns) int8
        The map of each robot.
    origins : (rows, 2) float64
        Where cell (0, 0) of each map begins [m].
    windows : (rows, 4) int64
        What part of each map has changed since ``forget_changes``: row_low, row_high, column_low,
        column_high.
    belief_rows : (rows, 5) int64
        Where the maps lie (``maps`` of ``kernels.arrays``).
    pool_rows : (rows, scales, 3) int64
        Address, rows and columns of each robot's pooled maps.
    contact, heard : (rows, robots) uint8, (rows, robots * 3) float64
        Of which teammates a robot knows the pose although not all are known, and these poses [m, rad]; the
        radio writes them.
    renderings : (rows,) int64
        How often each map was rendered again.
    """

    def __init__(
        self, rows: int, robots: int, occupancy: OccupancySettings, scales: Sequence[int], is_true: bool
    ) -> None:
        self.occupancy, self.scales = occupancy, tuple(scales)
        self.increments, self._is_true = occupancy.increments, is_true
        self.believed, self.origins = np.zeros((rows, 3)), np.zeros((rows, 2))
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
        row : int
            The robot.
        floor : FloorTables
            Where it is.
        start : (3,) float64 or None
            Its start in the floor's frame; None where it does not know it.
        shape : (rows, columns)
            Size of the floor [map cells].
        pages : Pages
            Where maps are kept.
        """
        resolution = self.occupancy.resolution
        self.believed[row] = 0.0 if start is None else start
        if start is None:
            self.log_odds[row], self.origins[row] = map_around_start(pages, floor, resolution)
        elif self._is_true:
            self.log_odds[row], self.origins[row] = pages.blank(shape, np.int8), floor.laser.origin
        else:
            self.log_odds[row], self.origins[row] = map_with_margin(pages, floor, *shape, resolution)
        height, width = self.log_odds[row].shape
        # At scale 1 a map is its own pooled map.
        self._pools[row] = [
            pages.blank((-(-height // scale), -(-width // scale)), np.int8)
            if scale > 1
            else self.log_odds[row]
            for scale in self.scales
        ]
        self._touched[row] = pages.blank(untouched(height if self.scales else 0, width).shape, np.uint64)
        self.contact[row], self.heard[row] = 0, 0.0

    def point_at(self, row: int) -> None:
        """Note where the maps of a robot lie, for kernels."""
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
