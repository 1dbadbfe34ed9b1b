"""Navigation maps that are the sum of a team's maps."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.navigation import (
    LOG_ODDS,
    extend_window,
    is_inside,
    log_odds_of,
    refresh_map,
    take_in,
)
from lidarium.envs.simulation.kernels.arrays import MAP, MAP_COLUMNS, MAP_ROWS
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.llvm import BLOCK
from lidarium.mapping.kernels.simd.cells import positive_cells, sum_blocks
from lidarium.mapping.kernels.views import vector_at
from lidarium.mapping.planning.clearance import (
    Window,
    list_cells,
    room_for_cells,
)


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
    for row in range(window[0], window[1]):
        if width < BLOCK:
            word = np.uint64(0)
            for k in range(width):
                word |= np.uint64(_sum_cell(beliefs, row * columns + window[2] + k, total)) << np.uint64(k)
            changed, count = list_cells(changed, count, word, row, window[2])
            continue
        for block in range(window[2], window[3], BLOCK):
            # The last block may overlap the one before, whose cells it sums again.
            column = min(block, window[3] - BLOCK)
            word = _sum_block(beliefs, row * columns + column, total)
            if word != np.uint64(0):
                changed, count = list_cells(changed, count, word, row, column)
    cells: Array = changed[:count]
    return cells


@kernel(forceinline=True)
def _sum_block(beliefs: Array, place: int, total: Array) -> np.uint64:
    """Sum a block of the maps.

    Tell which of its cells became occupied or ceased to be.
    """
    target = total.ctypes.data + place
    before = positive_cells(target)
    sum_blocks(beliefs[0, MAP:].ctypes.data, beliefs.strides[0], beliefs.shape[0], place, target)
    changed: np.uint64 = before ^ positive_cells(target)
    return changed


@kernel(forceinline=True)
def _sum_cell(beliefs: Array, place: int, total: Array) -> bool:
    """Sum a cell of the maps; return whether it became occupied or ceased to be."""
    value = int(vector_at(beliefs[0, MAP] + place, 1, np.int8)[0])
    for k in range(1, beliefs.shape[0]):
        value += int(vector_at(beliefs[k, MAP] + place, 1, np.int8)[0])
    cell = total.reshape(-1)
    was_occupied, cell[place] = cell[place] > 0, np.int8(min(max(value, -127), 127))
    return bool(was_occupied != (value > 0))


class TeamMaps(NamedTuple):
    """The maps of many teams, for kernels; row = episode * robots + robot.

    Attributes
    ----------
    robots : int
        Robots of a team.
    own, shared : (rows, 10), (episodes, 10) int64
        Records of the robots' own maps and of the teams', zeros if they do not exist.
    beliefs : (rows, 3) int64
        Address, rows and columns of each robot's log-odds.
    windows, known : (rows, 4) int64
        Part of each robot's log-odds that has changed since the last update, and the part that had ever changed by
        then.
    steps, fresh_at : (episodes,) int64
        The step of each episode, and the one at which its maps were last brought up to date.
    limit, stamp : int, (2 k + 1, 2 k + 1 and more) uint16
        Limit and stamp of the clearance, see ``ClearanceField``.
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
    inside = is_inside(record, window)
    # Only this kernel writes a sum, so its changed part is known without reading its clearance, which takes twice the
    # memory of a map.
    take_in(record, limit, stamp, inside, _sum_maps(beliefs, inside, log_odds_of(record)))


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
