"""A map with its planning data.

Kernels update the maps of many teams.

Kernels find a map through its *record*: a row of whole numbers with the addresses of its arrays. Frontiers
are kept from the first time that somebody asks for them, so that driving by waypoints never touches their
memory.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import grid_at
from lidarium.mapping.planning.clearance import ClearanceField, Window, changed_cells, update_around
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.frontiers.frontier_map import FrontierMap, update_frontiers
from lidarium.mapping.planning.path_costs import PathCosts
from lidarium.mapping.planning.search.path_search import SearchSpace

CLEARANCE_LIMIT = 0.6
"""Clearance is known exactly up to this [m]."""


LOG_ODDS, ROWS, COLUMNS, CLOSENESS, FLAGS, TILES, ROW_LOW, ROW_HIGH, COLUMN_LOW, COLUMN_HIGH = range(10)
"""Places in a record: addresses, shape and the known window.

Addresses are 0 for arrays that are not kept. Nothing is known outside the window.
"""


RECORD = 10
"""Numbers of a record."""


class NavigationMap:
    """A map of log-odds with its clearance and frontiers.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map; its owner may write it and then calls ``changed``. Initially blank, or followed by a call of
        ``changed``.
    resolution : float
        Side of a cell [m].
    """

    def __init__(self, log_odds: NDArray[np.int8], resolution: float) -> None:
        self._log_odds, self.resolution = log_odds, resolution
        rows, columns = log_odds.shape
        self.clearance = ClearanceField((rows, columns), resolution, CLEARANCE_LIMIT)
        self._frontiers: FrontierMap | None = None
        self._space: SearchSpace | None = None
        self._path_costs: dict[Footprint, PathCosts] = {}
        self._long: FrontierMap | None = None
        self._long_cells: NDArray[np.int64] = np.zeros((0, 2), np.int64)
        self._record: NDArray[np.int64] = np.zeros(RECORD, np.int64)
        self._record[ROW_LOW:] = (rows, 0, columns, 0)
        self._point()

    @property
    def log_odds(self) -> NDArray[np.int8]:
        """The map, read-only: only its owner, which holds the array itself, writes it."""
        view = self._log_odds.view()
        view.flags.writeable = False
        return view

    @property
    def frontiers(self) -> FrontierMap:
        """The frontiers, kept up to date from the first call on."""
        if self._frontiers is None:
            self._frontiers = FrontierMap(self._log_odds.shape, self.resolution)
            row_low, row_high, column_low, column_high = (int(value) for value in self._record[ROW_LOW:])
            if row_low < row_high and column_low < column_high:
                self._frontiers.update(self._log_odds, (row_low, row_high, column_low, column_high))
            self._point()
        return self._frontiers

    @property
    def space(self) -> SearchSpace:
        """Scratch memory for searches over this map."""
        if self._space is None:
            self._space = SearchSpace((self._log_odds.shape[0], self._log_odds.shape[1]), self.resolution)
        return self._space

    def path_costs(self, footprint: Footprint) -> PathCosts:
        """Return the costs of a body's paths, which are kept until the map changes around them."""
        if footprint not in self._path_costs:
            self._path_costs[footprint] = PathCosts(self.space, self._log_odds, self.clearance, footprint)
        return self._path_costs[footprint]

    def changed(self, window: Window) -> None:
        """Update clearance and frontiers in a window.

        The window is (row_low, row_high, column_low, column_high).
        """
        refresh_map(self._record, self.clearance.limit, self.clearance.stamp, np.array(window, np.int64))

    def keep_record_in(self, record: NDArray[np.int64]) -> None:
        """Use ``record`` (10,) as the record from which kernels look up the map."""
        record[:] = self._record
        self._record = record
        self._point()

    @property
    def record(self) -> NDArray[np.int64]:
        """Record from which kernels look up the map, (10,)."""
        return self._record

    def _point(self) -> None:
        """Write the addresses of the arrays into the record."""
        frontiers = self._frontiers
        flags, tiles = (0, 0) if frontiers is None else (frontiers.flags.ctypes.data, frontiers.tiles.ctypes.data)
        addresses = (
            self._log_odds.ctypes.data,
            *self._log_odds.shape,
            self.clearance.closeness.ctypes.data,
            flags,
            tiles,
        )
        self._record[:ROW_LOW] = addresses

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._record = self._record.copy()
        self._point()

    def long_frontiers(self, minimum_size: float) -> FrontierMap:
        """Return the frontiers without those shorter than ``minimum_size`` [m].

        Valid until the next call.
        """
        if self._long is None:
            self._long = FrontierMap(self.log_odds.shape, self.resolution)
        self._long.remove(self._long_cells)
        self._long_cells = self.frontiers.clusters(
            minimum_cells=max(math.ceil(minimum_size / self.resolution - 1e-9), 1)
        ).cells
        self._long.add(self._long_cells)
        return self._long


@kernel(forceinline=True)
def log_odds_of(record: Array) -> Any:  # noqa: ANN401
    """View the log-odds (rows, columns) int8 of a record (kernel)."""
    return grid_at(record[LOG_ODDS], record[ROWS], record[COLUMNS], np.int8)


@kernel(forceinline=True)
def closeness_of(record: Array) -> Any:  # noqa: ANN401
    """View the closeness (rows, columns) uint16 of a record (kernel)."""
    return grid_at(record[CLOSENESS], record[ROWS], record[COLUMNS], np.uint16)


@kernel(forceinline=True)
def flags_of(record: Array) -> Any:  # noqa: ANN401
    """View the frontier flags (rows, columns) uint8 of a record (kernel).

    The record must keep them.
    """
    return grid_at(record[FLAGS], record[ROWS], record[COLUMNS], np.uint8)


@kernel(forceinline=True)
def tiles_of(record: Array) -> Any:  # noqa: ANN401
    """View the counts of frontier cells by tiles of a record, int32 (kernel).

    Tiles are 16 x 16 cells. The record must keep the counts.
    """
    return grid_at(record[TILES], (record[ROWS] + 15) // 16, (record[COLUMNS] + 15) // 16, np.int32)


@kernel
def refresh_map(record: Array, limit: int, stamp: Array, window: Array) -> None:
    """Update clearance and frontiers in a window (4,) of a map (kernel).

    The window is the changed part of the map; frontiers are updated if they are kept.
    """
    inside = is_inside(record, window)
    take_in(record, limit, stamp, inside, changed_cells(log_odds_of(record), closeness_of(record), limit, inside))


@kernel(nrt=False)
def is_inside(record: Array, window: Array) -> Window:
    """Return the part of a window (4,) that lies within a map."""
    return max(window[0], 0), min(window[1], record[ROWS]), max(window[2], 0), min(window[3], record[COLUMNS])


@kernel
def take_in(record: Array, limit: int, stamp: Array, inside: Window, changed: Array) -> None:
    """Update the planning data of a map that changed in a window.

    The cells (N, 2) became occupied or ceased to be.
    """
    if inside[0] >= inside[1] or inside[2] >= inside[3]:
        return
    extend_window(record[ROW_LOW:], np.array(inside))
    update_around(log_odds_of(record), closeness_of(record), limit, stamp, changed)
    if record[FLAGS] != 0:
        update_frontiers(log_odds_of(record), flags_of(record), tiles_of(record), inside)


@kernel(nrt=False)
def extend_window(known: Array, window: Array) -> None:
    """Extend a window (4,) to hold another one that is not empty (kernel)."""
    if window[0] < window[1] and window[2] < window[3]:
        known[0], known[1] = min(known[0], window[0]), max(known[1], window[1])
        known[2], known[3] = min(known[2], window[2]), max(known[3], window[3])
