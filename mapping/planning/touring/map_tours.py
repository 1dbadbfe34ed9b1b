"""Tours past the frontiers of many maps, planned again and again as the maps grow, by one kernel on all threads.

Of each map the gains of views are kept until the map changes within their reach. Lengths of paths are found anew, from
all robots at once and then from all views: that takes less than to bring those of the last plan up to date. A plan from
what is kept equals one from nothing to the bit.
"""

import math
from typing import Annotated, Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.grid_lines import line_is_open
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.ordering import stable_order
from lidarium.mapping.kernels.simd.lengths import FAR, FEW_LANES, LANES, STRAIGHT
from lidarium.mapping.kernels.views import arrays_at
from lidarium.mapping.kernels.work_queue import Work, share_of, take_next
from lidarium.mapping.planning.frontiers.views import ViewFrame, offsets_of, view_gain
from lidarium.mapping.planning.touring.many_lengths import Cells, lengths_from_few, lengths_from_many, number_cells
from lidarium.mapping.planning.touring.open_cells import Standing, open_cells
from lidarium.mapping.planning.touring.tours import TourWeights, team_tours

NO_PATH = 1e4
"""Length of a path that there is none of [m]."""

AHEAD = 0.5
"""The direction in which a path begins is that of a place about so far along it [m]."""

SAME = 0.5
"""Frontiers nearer than this to what a robot drives to are what it drives to [m]."""

_TILE = 16
"""Side of the squares of cells in which changes of a map are looked for."""

_MOST_PLACES = 512
"""Maximum number of places from which a frontier is looked at."""


class _Kept(NamedTuple):
    """State kept of a map, and the inputs of its next plan. Coarse grids are absolute; most have a border of a cell.

    Attributes
    ----------
    is_open : (rows + 2, columns + 2) uint8
        Scratch: open coarse cells; zeros between plans.
    cell_numbers : (rows + 2, columns + 2) int32
        Numbers of the open coarse cells of the last plan, see ``Cells``.
    levels : (map rows, map columns) int8
        Signs of the log-odds at the last plan.
    gains : (rows, columns) float64
        Gain of a view from each coarse cell [m2], nan if it is not known.
    tried : (rows, columns) int64
        Scratch: the last frontier that was looked at from each coarse cell, counted over all plans.
    bounds : (5,) int64
        First and last rows and columns of coarse cells of the last plan, the last exclusive, and the number of
        frontiers that were looked at.
    log_odds, closeness : (map rows, map columns) int8, uint16
        The map and its clearance.
    cells, starts : (N, 2), (K + 1,) int64
        Frontier cells, and where each frontier begins.
    """

    is_open: Annotated[Array, np.uint8, 2]
    cell_numbers: Annotated[Array, np.int32, 2]
    levels: Annotated[Array, np.int8, 2]
    gains: Annotated[Array, np.float64, 2]
    tried: Annotated[Array, np.int64, 2]
    bounds: Annotated[Array, np.int64, 1]
    log_odds: Annotated[Array, np.int8, 2]
    closeness: Annotated[Array, np.uint16, 2]
    cells: Annotated[Array, np.int64, 2]
    starts: Annotated[Array, np.int64, 1]


class PlanRules(NamedTuple):
    """How tours are planned, in cells and metres.

    Attributes
    ----------
    resolution, side : float
        Side of a cell of the map, and of a coarse cell [m].
    factor, max_closeness, near_start : int
        Where bodies stand, see ``Standing``.
    least_gain : float
        Frontiers that show less are left out [m2].
    turn_length : float
        Length of path that a radian of turning costs [m/rad].
    longest, total, waiting : float
        Weights of tours, see ``TourWeights``. Parallel kernels take no tuples of one type within others.
    """

    resolution: float
    side: float
    factor: int
    max_closeness: int
    near_start: int
    least_gain: float
    turn_length: float
    longest: float
    total: float
    waiting: float


class Robots(NamedTuple):
    """The robots of M maps, up to R on each.

    Attributes
    ----------
    counts : (M,) int64
        Number of robots.
    windows : (M, 4) int64
        Rows and columns of each map beyond which nothing is known, the last exclusive.
    poses : (M, R, 3) float64
        x, y from the corner of the map's first cell, and heading [m, rad].
    kept_cells : (M, R, 2) int64
        The frontier cell that each drives to, -1 for none.
    kept : (M, R) float64
        How much shorter another tour has to be [m].
    """

    counts: NDArray[np.int64]
    windows: NDArray[np.int64]
    poses: NDArray[np.float64]
    kept_cells: NDArray[np.int64]
    kept: NDArray[np.float64]


class Plans(NamedTuple):
    """Plans of M maps with up to R robots and P views each; see ``TourOptions``.

    Attributes
    ----------
    counts : (M,) int64
        Number of views.
    frames : (M, 4) int64
        First and last rows and columns of coarse cells around all that is free.
    places, cells : (M, P, 2) int64
        Coarse cells of the views within these, and the cell of the map with maximum clearance in each.
    numbers : (M, P) int64
        Numbers of their frontiers.
    gains : (M, P) float64
        Unknown area in view [m2].
    lengths, turns, first : (M, R, P) float64
        Lengths of paths [m], turns [rad] and costs [m] of setting out.
    is_kept : (M, R, P) bool
        The present goal of each robot.
    between : (M, P, P) float64
        Lengths of paths from view to view [m].
    sequences : (M, P + R - 1) int64
        The tours.
    """

    counts: NDArray[np.int64]
    frames: NDArray[np.int64]
    places: NDArray[np.int64]
    cells: NDArray[np.int64]
    numbers: NDArray[np.int64]
    gains: NDArray[np.float64]
    lengths: NDArray[np.float64]
    turns: NDArray[np.float64]
    first: NDArray[np.float64]
    is_kept: NDArray[np.bool_]
    between: NDArray[np.float64]
    sequences: NDArray[np.int64]


class TourMemory:
    """State kept of a map between plans; copies begin with none.

    Parameters
    ----------
    shape : (rows, columns)
        Shape of the map.
    factor : int
        Side of a coarse cell [cells].

    Attributes
    ----------
    arrays : list
        What is kept, as the first of ``_Kept``.
    """

    def __init__(self, shape: tuple[int, int], factor: int) -> None:
        self._made_of = shape, factor
        rows, columns = -(-shape[0] // factor), -(-shape[1] // factor)
        self.arrays: list[NDArray[Any]] = [
            np.zeros((rows + 2, columns + 2), np.uint8),
            np.zeros((rows + 2, columns + 2), np.int32),
            np.zeros(shape, np.int8),
            np.full((rows, columns), np.nan),
            np.zeros((rows, columns), np.int64),
            np.zeros(5, np.int64),
        ]

    def __reduce__(self) -> Any:  # noqa: ANN401
        return TourMemory, self._made_of


@kernel
def plan_serial(tables: Array, robots: Robots, rules: PlanRules, sight: ViewFrame, plans: Plans, work: Work) -> None:
    """Plan the tours of the maps that are left: tables (M, fields of ``_Kept``, 3)."""
    item = take_next(work.taken)
    while item < len(work.items):
        number = work.items[item]
        _plan_one(arrays_at(tables[number], _Kept), robots, rules, sight, plans, number)
        item = take_next(work.taken)


@kernel(parallel=True)
def plan_parallel(tables: Array, robots: Robots, rules: PlanRules, sight: ViewFrame, plans: Plans, work: Work) -> None:
    """Plan the tours on threads; see ``plan_serial``."""
    for thread in numba.prange(work.threads):
        plan_serial(tables, robots, rules, sight, plans, share_of(work, thread))


@kernel
def _plan_one(kept: _Kept, robots: Robots, rules: PlanRules, sight: ViewFrame, plans: Plans, number: int) -> None:
    """Plan the tours on a map."""
    count, columns = robots.counts[number], kept.is_open.shape[1]
    plans.counts[number] = 0
    _forget_gains(kept, robots.windows[number], rules.factor, sight.reach)
    starts = np.empty((count, 2), np.int64)
    for k in range(count):
        starts[k, 0] = math.floor(robots.poses[number, k, 1] / rules.resolution)
        starts[k, 1] = math.floor(robots.poses[number, k, 0] / rules.resolution)
    frame = plans.frames[number]
    frame[0], frame[1], frame[2], frame[3] = open_cells(
        kept.log_odds,
        kept.closeness,
        robots.windows[number],
        starts,
        Standing(rules.factor, rules.max_closeness, rules.near_start),
        kept.is_open,
    )
    last = kept.bounds
    kept.cell_numbers[last[0] + 1 : last[1] + 1, last[2] + 1 : last[3] + 1] = 0
    last[:4] = frame
    cells = number_cells(kept.is_open, frame, kept.cell_numbers)
    at = np.empty(count, np.int64)
    for k in range(count):
        row = min(max(starts[k, 0] // rules.factor, frame[0]), frame[1] - 1)
        column = min(max(starts[k, 1] // rules.factor, frame[2]), frame[3] - 1)
        starts[k, 0], starts[k, 1] = row, column
        at[k] = (row + 1) * columns + column + 1
    from_robots = lengths_from_few(cells, at)
    views, gains = _view_all(kept, cells, at, from_robots, frame, rules.factor, sight)
    chosen = _nearest(cells, at, from_robots, views, gains, plans.numbers.shape[1], rules.least_gain)
    if len(chosen) == 0:
        return
    n = plans.counts[number] = len(chosen)
    places = views[chosen]
    for i in range(n):
        plans.numbers[number, i], plans.gains[number, i] = chosen[i], gains[chosen[i]]
        row, column = places[i] // columns - 1, places[i] % columns - 1
        plans.places[number, i, 0], plans.places[number, i, 1] = row - frame[0], column - frame[2]
        _roomiest(kept, row, column, rules.factor, plans.cells[number, i])
    towards = np.empty((count, n), np.int64)
    for begin in range(0, n, LANES):
        group = places[begin : begin + LANES]
        lanes = lengths_from_many(cells, group, from_robots[0], at[:FEW_LANES])
        for i in range(len(group)):
            plans.between[number, begin + i, begin + i] = 0.0
            for j in range(begin + i + 1, n):
                length = 0 if places[j] == group[i] else lanes[cells.numbers.reshape(-1)[places[j]], i]
                metres = _metres(length, rules.side)
                plans.between[number, begin + i, j] = plans.between[number, j, begin + i] = metres
        for k in range(count):
            _find_ahead(cells, lanes, group, starts[k], frame, rules, towards[k, begin : begin + len(group)])
    first = plans.first[number]
    for k in range(count):
        pose, goal = robots.poses[number, k], robots.kept_cells[number, k]
        for i in range(n):
            metres = _metres(_from_robot(cells, from_robots, at, k, places[i]), rules.side)
            turn = _turn(towards[k, i], columns, pose, rules)
            is_kept = goal[0] >= 0 and _is_near(kept, chosen[i], goal, SAME / rules.resolution)
            plans.lengths[number, k, i], plans.turns[number, k, i] = metres, turn
            plans.is_kept[number, k, i] = is_kept
            first[k, i] = metres + rules.turn_length * turn - robots.kept[number, k] * is_kept
    plans.sequences[number, : n + count - 1] = team_tours(
        first[:count, :n].copy(),
        plans.between[number, :n, :n].copy(),
        plans.gains[number, :n].copy(),
        TourWeights(rules.longest, rules.total, rules.waiting),
    )


@kernel
def _forget_gains(kept: _Kept, window: Array, factor: int, reach: int) -> None:
    """Forget the gains of views within reach of changes, and note the map as it is now."""
    reach = -(-(reach + 2) // _TILE)
    rows, columns = kept.levels.shape
    low_row, end_row = max(window[0] // _TILE - reach, 0), min((window[1] - 1) // _TILE + reach + 1, -(-rows // _TILE))
    low_column = max(window[2] // _TILE - reach, 0)
    end_column = min((window[3] - 1) // _TILE + reach + 1, -(-columns // _TILE))
    is_stale = np.zeros((max(end_row - low_row, 0), max(end_column - low_column, 0)), np.bool_)
    for row in range(window[0] // _TILE, (window[1] - 1) // _TILE + 1):
        for column in range(window[2] // _TILE, (window[3] - 1) // _TILE + 1):
            if _note_changes(kept, row * _TILE, column * _TILE):
                is_stale[
                    max(row - reach - low_row, 0) : row + reach + 1 - low_row,
                    max(column - reach - low_column, 0) : column + reach + 1 - low_column,
                ] = True
    coarse_rows, coarse_columns = kept.gains.shape
    for i in range(is_stale.shape[0]):
        for j in range(is_stale.shape[1]):
            if is_stale[i, j]:
                row, column = (low_row + i) * _TILE, (low_column + j) * _TILE
                kept.gains[
                    row // factor : min((row + _TILE - 1) // factor + 1, coarse_rows),
                    column // factor : min((column + _TILE - 1) // factor + 1, coarse_columns),
                ] = np.nan


@kernel(nrt=False)
def _note_changes(kept: _Kept, row: int, column: int) -> bool:
    """Note the signs of the map in a square of cells; return whether one of them has changed."""
    changed, end = np.int8(0), min(column + _TILE, kept.levels.shape[1])
    for i in range(row, min(row + _TILE, kept.levels.shape[0])):
        now, before = kept.log_odds[i, column:end], kept.levels[i, column:end]
        for j in range(now.size):
            sign = np.int8(np.int8(now[j] > 0) - np.int8(now[j] < 0))
            changed |= before[j] ^ sign
            before[j] = sign
    return bool(changed != 0)


@kernel
def _view_all(
    kept: _Kept, cells: Cells, at: Array, from_robots: Array, frame: Array, factor: int, sight: ViewFrame
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the view of each frontier as a cell of the grid with its border, -1 for none, and its gain [m2].

    It has the shortest path from any robot of those that show a share of the best view.
    """
    count, columns = len(kept.starts) - 1, kept.is_open.shape[1]
    views, gains = np.full(count, -1, np.int64), np.zeros(count)
    places, shown, lengths = np.empty(_MOST_PLACES, np.int64), np.empty(_MOST_PLACES), np.empty(_MOST_PLACES, np.int64)
    offsets = offsets_of(sight, kept.log_odds.shape[1])
    for k in range(count):
        number = _look(kept, cells, at, from_robots, k, frame, factor, sight, offsets, (places, shown, lengths))
        if number == 0:
            continue
        wanted, least = sight.kept_share * shown[:number].max(), np.int64(FAR)
        for i in range(number):
            if shown[i] >= wanted and lengths[i] < least:
                row, column = places[i] // columns, places[i] % columns
                views[k], gains[k], least = (row + 1) * columns + column + 1, shown[i], lengths[i]
    return views, gains


@kernel(nrt=False)
def _look(
    kept: _Kept,
    open_cells: Cells,
    starts: Array,
    from_robots: Array,
    number: int,
    frame: Array,
    factor: int,
    sight: ViewFrame,
    offsets: Array,
    found: tuple[Array, Array, Array],
) -> int:
    """Write the coarse cells that see a frontier, their gains [m2] and the paths there; return how many there are."""
    places, shown, lengths = found
    columns = kept.is_open.shape[1]
    rows, width = frame[1] - frame[0], frame[3] - frame[2]
    kept.bounds[4] += 1
    turn = kept.bounds[4]
    cells = kept.cells[kept.starts[number] : kept.starts[number + 1]]
    count, step = 0, max(sight.spacing * factor, 1)
    for i in range((len(cells) % step) // 2, len(cells), step):
        row, column = cells[i, 0], cells[i, 1]
        middle_row = (row - frame[0] * factor) // factor
        middle_column = (column - frame[2] * factor) // factor
        low = -(-max(middle_row - sight.around, 0) // sight.spacing) * sight.spacing
        left = -(-max(middle_column - sight.around, 0) // sight.spacing) * sight.spacing
        for at in range(low, min(middle_row + sight.around + 1, rows), sight.spacing):
            for across in range(left, min(middle_column + sight.around + 1, width), sight.spacing):
                at_row, at_column = frame[0] + at, frame[2] + across
                if kept.tried[at_row, at_column] == turn or count == len(places):
                    continue
                length, cell = np.int64(FAR), (at_row + 1) * columns + at_column + 1
                for k in range(len(starts)):
                    length = min(length, _from_robot(open_cells, from_robots, starts, k, cell))
                if length == FAR:
                    continue
                # The last coarse row or column may be a part of one.
                place_row = min(at_row * factor + factor // 2, kept.log_odds.shape[0] - 1)
                place_column = min(at_column * factor + factor // 2, kept.log_odds.shape[1] - 1)
                if not line_is_open(kept.log_odds, place_row, place_column, row, column):
                    continue
                kept.tried[at_row, at_column] = turn
                gain = kept.gains[at_row, at_column]
                if math.isnan(gain):
                    gain = view_gain(kept.log_odds, place_row, place_column, sight, offsets)
                    kept.gains[at_row, at_column] = gain
                places[count], shown[count], lengths[count] = at_row * columns + at_column, gain, length
                count += 1
    return count


@kernel(nrt=False)
def _from_robot(cells: Cells, from_robots: Array, starts: Array, robot: int, cell: int) -> int:
    """Return the length of the path from a robot to a cell, ``FAR`` if there is none; it may stand in a closed one."""
    if starts[robot] == cell:
        return 0
    return int(from_robots[robot // FEW_LANES, cells.numbers.reshape(-1)[cell], robot % FEW_LANES])


@kernel
def _nearest(
    cells: Cells, starts: Array, from_robots: Array, views: Array, gains: Array, most: int, least_gain: float
) -> NDArray[np.int64]:
    """Return the numbers of the frontiers to visit, the nearest to any robot first.

    Each robot in turn takes its nearest: a team that is spread out has something to visit everywhere.
    """
    robots, count = len(starts), len(views)
    lengths, turns = np.full((robots, count), FAR, np.int64), np.full(count, 1 << 30, np.int64)
    nearest = np.full(count, FAR, np.int64)
    for k in range(robots):
        for i in range(count):
            if views[i] >= 0 and gains[i] >= least_gain:
                lengths[k, i] = _from_robot(cells, from_robots, starts, k, views[i])
                nearest[i] = min(nearest[i], lengths[k, i])
        order = stable_order(lengths[k])
        for rank in range(count):
            if lengths[k, order[rank]] != FAR:
                turns[order[rank]] = min(turns[order[rank]], rank * robots + k)
    order = stable_order(turns)[:most]
    chosen = order[turns[order] < 1 << 30]
    chosen = chosen[stable_order(chosen)]
    nearest_first: NDArray[np.int64] = chosen[stable_order(nearest[chosen])]
    return nearest_first


@kernel(nrt=False)
def _metres(length: int, side: float) -> float:
    """Return a length in metres."""
    metres: float = NO_PATH if length == FAR else length * (side / STRAIGHT)
    return metres


@kernel
def _find_ahead(
    cells: Cells, lanes: Array, places: Array, start: Array, frame: Array, rules: PlanRules, towards: Array
) -> None:
    """Write the cell near a robot from which the path to each place is shortest, the first of equal ones."""
    reach, columns = max(round(AHEAD / rules.side), 1), cells.numbers.shape[1]
    low_row, low_column = max(start[0] - reach, frame[0]), max(start[1] - reach, frame[2])
    least = np.full(len(places), FAR, np.int64)
    towards[:] = (low_row + 1) * columns + low_column + 1
    for row in range(low_row, min(start[0] + reach + 1, frame[1])):
        for column in range(low_column, min(start[1] + reach + 1, frame[3])):
            cell, number = (row + 1) * columns + column + 1, cells.numbers[row + 1, column + 1]
            for i in range(len(places)):
                length = 0 if cell == places[i] else np.int64(lanes[number, i])
                if length < least[i]:
                    least[i], towards[i] = length, cell


@kernel(nrt=False)
def _turn(towards: int, columns: int, pose: Array, rules: PlanRules) -> float:
    """Return by how much a robot turns to set out to a cell [rad]."""
    x = (towards % columns - 0.5) * rules.factor * rules.resolution - pose[0]
    y = (towards // columns - 0.5) * rules.factor * rules.resolution - pose[1]
    if math.hypot(x, y) <= rules.side:
        return 0.0
    turn: float = abs((math.atan2(y, x) - pose[2] + math.pi) % (2.0 * math.pi) - math.pi)
    return turn


@kernel(nrt=False)
def _is_near(kept: _Kept, number: int, goal: Array, reach: float) -> bool:
    """Whether a frontier has a cell near to a goal."""
    for i in range(kept.starts[number], kept.starts[number + 1]):
        if max(abs(kept.cells[i, 0] - goal[0]), abs(kept.cells[i, 1] - goal[1])) < reach:
            return True
    return False


@kernel(nrt=False)
def _roomiest(kept: _Kept, row: int, column: int, factor: int, cell: Array) -> None:
    """Write the cell of the map with maximum clearance in a coarse cell."""
    least = np.int64(1 << 30)
    for i in range(row * factor, min((row + 1) * factor, kept.log_odds.shape[0])):
        for j in range(column * factor, min((column + 1) * factor, kept.log_odds.shape[1])):
            closeness = np.int64(kept.closeness[i, j]) if kept.log_odds[i, j] < 0 else np.int64(1 << 20)
            if closeness < least:
                least, cell[0], cell[1] = closeness, i, j
