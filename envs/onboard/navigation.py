"""A map with what planning needs of it.

Kernels update the maps of many teams.

Kernels find a map through its *record*: a row of whole numbers with the addresses of its arrays. Frontiers
are kept from the first time that somebody asks for them, so that driving by waypoints never touches their
memory.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.kernels.arrays import MAP, MAP_COLUMNS, MAP_ROWS
from lidarium.mapping.kernels.cell_blocks import positive_cells, sum_blocks
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.vectors import BLOCK
from lidarium.mapping.kernels.views import (
    int8_at,
    int8_grid_at,
    int32_table_at,
    uint8_grid_at,
    uint16_grid_at,
)
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.clearance_updates import (
    Window,
    changed_cells,
    list_cells,
    room_for_cells,
    update_around,
)
from lidarium.mapping.planning.frontiers import FrontierMap, update_frontiers
from lidarium.mapping.planning.search.search_space import SearchSpace

CLEARANCE_LIMIT = 0.6
"""Clearance is told exactly up to this [m]."""

LOG_ODDS, ROWS, COLUMNS, CLOSENESS, FLAGS, TILES, ROW_LOW, ROW_HIGH, COLUMN_LOW, COLUMN_HIGH = range(10)
"""Places in a record: addresses, shape and the known window.

Addresses are 0 for what is not kept. Nothing is known outside the window.
"""

RECORD = 10
"""Numbers of a record."""


class NavigationMap:
    """A map of log-odds with its clearance and frontiers.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map; it may be written by its owner, who says so by ``changed``. Blank, or followed by a call of
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
        self._long: FrontierMap | None = None
        self._long_cells: NDArray[np.int64] = np.zeros((0, 2), np.int64)
        self._record: NDArray[np.int64] = np.zeros(RECORD, np.int64)
        self._record[ROW_LOW:] = (rows, 0, columns, 0)
        self._point()

    @property
    def log_odds(self) -> NDArray[np.int8]:
        """The map, read-only: only its owner, who holds the array itself, writes it."""
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

    def changed(self, window: Window) -> None:
        """Update clearance and frontiers in a window.

        The window is (row_low, row_high, column_low, column_high).
        """
        refresh_map(self._record, self.clearance.limit, self.clearance.stamp, np.array(window, np.int64))

    def keep_record_in(self, record: NDArray[np.int64]) -> None:
        """Let ``record`` (10,) be where kernels look the map up."""
        record[:] = self._record
        self._record = record
        self._point()

    @property
    def record(self) -> NDArray[np.int64]:
        """Where kernels look the map up, (10,)."""
        return self._record

    def _point(self) -> None:
        """Write the addresses of the arrays into the record."""
        frontiers = self._frontiers
        flags, tiles = (
            (0, 0) if frontiers is None else (frontiers.flags.ctypes.data, frontiers.tiles.ctypes.data)
        )
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


@kernel(inline=True)
def log_odds_of(record: Array) -> Any:  # noqa: ANN401
    """View the log-odds (rows, columns) int8 of a record (kernel)."""
    return int8_grid_at(record[LOG_ODDS], record[ROWS], record[COLUMNS])


@kernel(inline=True)
def closeness_of(record: Array) -> Any:  # noqa: ANN401
    """View the closeness (rows, columns) uint16 of a record (kernel)."""
    return uint16_grid_at(record[CLOSENESS], record[ROWS], record[COLUMNS])


@kernel(inline=True)
def flags_of(record: Array) -> Any:  # noqa: ANN401
    """View the frontier flags (rows, columns) uint8 of a record (kernel).

    The record must keep them.
    """
    return uint8_grid_at(record[FLAGS], record[ROWS], record[COLUMNS])


@kernel(inline=True)
def tiles_of(record: Array) -> Any:  # noqa: ANN401
    """View the counts of frontier cells by tiles of a record, int32 (kernel).

    Tiles are 16 x 16 cells. The record must keep the counts.
    """
    return int32_table_at(record[TILES], (record[ROWS] + 15) // 16, (record[COLUMNS] + 15) // 16)


@kernel
def refresh_map(record: Array, limit: int, stamp: Array, window: Array) -> None:
    """Update clearance and frontiers in a window (4,) of a map (kernel).

    The window is where the map changed; frontiers are updated where they are kept.
    """
    inside = _inside(record, window)
    _take_in(
        record, limit, stamp, inside, changed_cells(log_odds_of(record), closeness_of(record), limit, inside)
    )


@kernel
def _inside(record: Array, window: Array) -> Window:
    """Return the part of a window (4,) that lies within a map."""
    return max(window[0], 0), min(window[1], record[ROWS]), max(window[2], 0), min(window[3], record[COLUMNS])


@kernel
def _take_in(record: Array, limit: int, stamp: Array, inside: Window, changed: Array) -> None:
    """Update what is kept beside a map that changed in a window.

    The cells (N, 2) became occupied or ceased to be.
    """
    if inside[0] >= inside[1] or inside[2] >= inside[3]:
        return
    extend_window(record[ROW_LOW:], np.array(inside))
    update_around(log_odds_of(record), closeness_of(record), limit, stamp, changed)
    if record[FLAGS] != 0:
        update_frontiers(log_odds_of(record), flags_of(record), tiles_of(record), inside)


@kernel
def extend_window(known: Array, window: Array) -> None:
    """Extend a window (4,) to hold another one that is not empty (kernel)."""
    if window[0] < window[1] and window[2] < window[3]:
        known[0], known[1] = min(known[0], window[0]), max(known[1], window[1])
        known[2], known[3] = min(known[2], window[2]), max(known[3], window[3])


@kernel
def _sum_maps(beliefs: Array, window: Window, total: Array) -> Array:
    """Write the sum of maps of one shape into ``total`` within a window.

    Nothing is written outside the window; the sum is clipped to [-127, 127].

    Returns
    -------
    (N, 2) int64
        The cells (row, column) of the sum that became occupied or ceased to be.
    """
    columns, width = total.shape[1], window[3] - window[2]
    changed, count = room_for_cells(), 0
    nothing = np.zeros(BLOCK, np.int8)
    for row in range(window[0], window[1]):
        if width < BLOCK:
            word = np.uint64(0)
            for k in range(width):
                word |= np.uint64(_sum_cell(beliefs, row * columns + window[2] + k, total)) << np.uint64(k)
            changed, count = list_cells(changed, count, word, row, window[2])
            continue
        for block in range(window[2], window[3], BLOCK):
            # The last block may overlap the one before, whose cells it sums anew.
            column = min(block, window[3] - BLOCK)
            word = _sum_block(beliefs, row * columns + column, total, nothing)
            if word != np.uint64(0):
                changed, count = list_cells(changed, count, word, row, column)
    cells: Array = changed[:count]
    return cells


@kernel(inline=True)
def _sum_block(beliefs: Array, place: int, total: Array, nothing: Array) -> np.uint64:
    """Sum a block of the maps.

    Tell which of its cells became occupied or ceased to be.
    """
    target = total.ctypes.data + place
    before = positive_cells(target)
    sum_blocks(
        beliefs[0, MAP] + place,
        beliefs[1, MAP] + place if beliefs.shape[0] > 1 else nothing.ctypes.data,
        target,
    )
    for k in range(2, beliefs.shape[0]):
        sum_blocks(target, beliefs[k, MAP] + place, target)
    changed: np.uint64 = before ^ positive_cells(target)
    return changed


@kernel(inline=True)
def _sum_cell(beliefs: Array, place: int, total: Array) -> bool:
    """Sum a cell of the maps; tell whether it became occupied or ceased to be."""
    value = int(int8_at(beliefs[0, MAP] + place, 1)[0])
    for k in range(1, beliefs.shape[0]):
        value = min(max(value + int(int8_at(beliefs[k, MAP] + place, 1)[0]), -127), 127)
    cell = total.reshape(-1)
    was_occupied, cell[place] = cell[place] > 0, np.int8(value)
    return bool(was_occupied != (value > 0))


class TeamMaps(NamedTuple):
    """The maps of many teams, for kernels; row = episode * robots + robot.

    Attributes
    ----------
    robots : int
        Robots of a team.
    own, shared : (rows, 10), (episodes, 10) int64
        Records of the robots' own maps and of the teams', zeros where there is none.
    beliefs : (rows, 3) int64
        Address, rows and columns of each robot's log-odds.
    windows, known : (rows, 4) int64
        What part of each robot's log-odds has changed since it was last taken in, and the part that ever had
        until then.
    steps, fresh_at : (episodes,) int64
        The step of each episode, and the one at which its maps were last brought up to date.
    limit, stamp : int, (2 k + 1, 2 k + 1 and more) uint16
        Of the clearance, see ``ClearanceField``.
    """

    robots: int
    own: NDArray[np.int64]
    shared: NDArray[np.int64]
    beliefs: NDArray[np.int64]
    windows: NDArray[np.int64]
    known: NDArray[np.int64]
    steps: NDArray[np.int64]
    fresh_at: NDArray[np.int64]
    limit: int
    stamp: NDArray[np.uint16]


@kernel
def sum_maps(record: Array, beliefs: Array, limit: int, stamp: Array, window: Array) -> None:
    """Sum maps (maps, 3 or more) into a record's map within a window (4,) (kernel).

    The maps have its shape and changed in this window.
    """
    inside = _inside(record, window)
    # Nobody else writes a sum: where it changed is known without a look at its clearance, which takes twice
    # the memory of a map.
    _take_in(record, limit, stamp, inside, _sum_maps(beliefs, inside, log_odds_of(record)))


@kernel
def sum_team(maps: TeamMaps, episode: int, window: Array) -> None:
    """Update the map of a team in a window (4,) of changes (kernel).

    In this window the robots' own maps changed.
    """
    first = episode * maps.robots
    sum_maps(maps.shared[episode], maps.beliefs[first : first + maps.robots], maps.limit, maps.stamp, window)


@kernel
def refresh_team(maps: TeamMaps, episode: int) -> None:
    """Update a team's maps by their changes since the last call (kernel).

    The changes are taken in robot by robot.
    """
    if maps.fresh_at[episode] == maps.steps[episode]:
        return
    maps.fresh_at[episode] = maps.steps[episode]
    for row in range(episode * maps.robots, (episode + 1) * maps.robots):
        window = maps.windows[row]
        if window[0] >= window[1] or window[2] >= window[3]:
            continue
        if maps.own[row, LOG_ODDS] != 0:
            refresh_map(maps.own[row], maps.limit, maps.stamp, window)
        if maps.shared[episode, LOG_ODDS] != 0:
            sum_team(maps, episode, window)
        extend_window(maps.known[row], window)
        window[0], window[1], window[2], window[3] = (
            maps.beliefs[row, MAP_ROWS],
            0,
            maps.beliefs[row, MAP_COLUMNS],
            0,
        )
