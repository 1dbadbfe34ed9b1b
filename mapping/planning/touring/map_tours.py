"""Tours past the frontiers of many maps, planned again and again as the maps grow, by one kernel on all threads.

Of each map is kept what its last plan found: the gains of views, until the map changes within their reach, and the
lengths of paths from views, brought up to date where cells have opened or closed. A plan from what is kept equals one
from nothing to the bit.
"""

import math
from typing import Annotated, Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.grid_lines import line_is_open
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.views import arrays_at
from lidarium.mapping.kernels.work_queue import Work, share_of, take_next
from lidarium.mapping.planning.frontiers.views import ViewFrame, view_gain
from lidarium.mapping.planning.touring.coarse_distances import STRAIGHT, UNREACHED
from lidarium.mapping.planning.touring.kept_lengths import (
    BUCKETS,
    CLOSED,
    begin_field,
    change_field,
    extend_field,
)
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
    """What is kept of a map, and the inputs of its next plan. Coarse grids are absolute; most have a border of a cell.

    Attributes
    ----------
    is_open, opening : (rows + 2, columns + 2) uint8
        Open coarse cells of the last plan, and of this one.
    levels : (map rows, map columns) int8
        Signs of the log-odds at the last plan.
    gains : (rows, columns) float64
        Gain of a view from each coarse cell [m2], nan if it is not known.
    fields : (slots, size) int32
        Lengths from views, see ``kept_lengths``.
    slots : (slots, 2) int64
        Start of each field, -1 for none, and its horizon.
    from_robots : (robots, size) int32
        Lengths from robots.
    queues : (BUCKETS, size) int32
        Scratch.
    changes : (2, size) int64
        Scratch: cells that have closed and opened.
    tried : (rows, columns) int64
        Scratch: the last frontier that was looked at from each coarse cell, counted over all plans.
    bounds : (5,) int64
        Rows and columns of the grid with its border that have ever been open, the last exclusive, and the number of
        frontiers that were looked at.
    log_odds, closeness : (map rows, map columns) int8, uint16
        The map and its clearance.
    cells, starts : (N, 2), (K + 1,) int64
        Frontier cells, and where each frontier begins.
    """

    is_open: Annotated[Array, np.uint8, 2]
    opening: Annotated[Array, np.uint8, 2]
    levels: Annotated[Array, np.int8, 2]
    gains: Annotated[Array, np.float64, 2]
    fields: Annotated[Array, np.int32, 2]
    slots: Annotated[Array, np.int64, 2]
    from_robots: Annotated[Array, np.int32, 2]
    queues: Annotated[Array, np.int32, 2]
    changes: Annotated[Array, np.int64, 2]
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
    """What is kept of a map between plans; copies begin with nothing.

    Parameters
    ----------
    shape : (rows, columns)
        Shape of the map.
    factor : int
        Side of a coarse cell [cells].
    most : int
        Maximum number of views on tours.
    """

    def __init__(self, shape: tuple[int, int], factor: int, most: int) -> None:
        self._made_of = shape, factor, most
        rows, columns = -(-shape[0] // factor), -(-shape[1] // factor)
        size = (rows + 2) * (columns + 2)
        bordered = np.zeros((2, rows + 2, columns + 2), np.uint8)
        # Memory of zeros is taken when it is first written to: most fields never are.
        self._arrays: list[NDArray[Any]] = [
            bordered[0],
            bordered[1],
            np.zeros(shape, np.int8),
            np.full((rows, columns), np.nan),
            np.zeros((most, size), np.int32),
            np.full((most, 2), -1, np.int64),
            np.zeros((1, size), np.int32),
            np.zeros((BUCKETS, size), np.int32),
            np.zeros((2, size), np.int64),
            np.zeros((rows, columns), np.int64),
            np.array([rows + 2, 0, columns + 2, 0, 0], np.int64),
        ]

    def arrays(self, robots: int) -> list[NDArray[Any]]:
        """Return the arrays that are kept, as the first of ``_Kept``."""
        if len(self._arrays[6]) < robots:
            self._arrays[6] = np.zeros((robots, self._arrays[6].shape[1]), np.int32)
        return self._arrays

    def __reduce__(self) -> Any:  # noqa: ANN401
        return TourMemory, self._made_of


@kernel(apart=True)
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
        kept.opening,
    )
    _renew_fields(kept, frame)
    at = np.empty(count, np.int64)
    for k in range(count):
        row = min(max(starts[k, 0] // rules.factor, frame[0]), frame[1] - 1)
        column = min(max(starts[k, 1] // rules.factor, frame[2]), frame[3] - 1)
        starts[k, 0], starts[k, 1] = row, column
        at[k] = (row + 1) * columns + column + 1
        begin_field(kept.from_robots[k], kept.is_open, kept.bounds, at[k])
        extend_field(kept.from_robots[k], columns, kept.bounds, 1, np.full(1, -1), kept.queues)
    views, gains = _view_all(kept, count, frame, rules.factor, sight)
    chosen = _nearest(kept, count, views, gains, plans.numbers.shape[1], rules.least_gain)
    if len(chosen) == 0:
        return
    n = plans.counts[number] = len(chosen)
    places = views[chosen]
    for i in range(n):
        plans.numbers[number, i], plans.gains[number, i] = chosen[i], gains[chosen[i]]
        row, column = places[i] // columns - 1, places[i] % columns - 1
        plans.places[number, i, 0], plans.places[number, i, 1] = row - frame[0], column - frame[2]
        _roomiest(kept, row, column, rules.factor, plans.cells[number, i])
    slots = _lengths_between(kept, places, at, rules.side, plans.between[number])
    first = plans.first[number]
    for k in range(count):
        pose, goal = robots.poses[number, k], robots.kept_cells[number, k]
        for i in range(n):
            length = _metres(kept.from_robots[k, places[i]], rules.side)
            turn = _turn(kept.fields[slots[i]], columns, pose, starts[k], frame, rules)
            is_kept = goal[0] >= 0 and _is_near(kept, chosen[i], goal, SAME / rules.resolution)
            plans.lengths[number, k, i], plans.turns[number, k, i] = length, turn
            plans.is_kept[number, k, i] = is_kept
            first[k, i] = length + rules.turn_length * turn - robots.kept[number, k] * is_kept
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
def _renew_fields(kept: _Kept, frame: Array) -> None:
    """Take over the open cells of this plan, and bring the kept lengths up to date."""
    bounds, is_open, opening = kept.bounds, kept.is_open, kept.opening
    bounds[0], bounds[1] = min(bounds[0], frame[0] + 1), max(bounds[1], frame[1] + 1)
    bounds[2], bounds[3] = min(bounds[2], frame[2] + 1), max(bounds[3], frame[3] + 1)
    columns, closed_count, opened_count = is_open.shape[1], 0, 0
    closed, opened = kept.changes[0], kept.changes[1]
    for row in range(bounds[0], bounds[1]):
        for column in range(bounds[2], bounds[3]):
            if is_open[row, column] != opening[row, column]:
                if opening[row, column]:
                    opened[opened_count] = row * columns + column
                    opened_count += 1
                else:
                    closed[closed_count] = row * columns + column
                    closed_count += 1
            is_open[row, column] = opening[row, column]
            opening[row, column] = 0
    for k in range(len(kept.slots)):
        if kept.slots[k, 0] >= 0:
            change_field(
                kept.fields[k],
                columns,
                kept.slots[k, 1],
                kept.slots[k, 0],
                closed[:closed_count],
                opened[:opened_count],
                kept.queues,
            )


@kernel
def _view_all(
    kept: _Kept, robots: int, frame: Array, factor: int, sight: ViewFrame
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the view of each frontier as a cell of the grid with its border, -1 for none, and its gain [m2].

    It has the shortest path from any robot of those that show a share of the best view.
    """
    count, columns = len(kept.starts) - 1, kept.is_open.shape[1]
    views, gains = np.full(count, -1, np.int64), np.zeros(count)
    places, shown, lengths = np.empty(_MOST_PLACES, np.int64), np.empty(_MOST_PLACES), np.empty(_MOST_PLACES, np.int64)
    for k in range(count):
        number = _look(kept, robots, k, frame, factor, sight, (places, shown, lengths))
        if number == 0:
            continue
        wanted, least = sight.kept_share * shown[:number].max(), np.int64(UNREACHED)
        for i in range(number):
            if shown[i] >= wanted and lengths[i] < least:
                row, column = places[i] // columns, places[i] % columns
                views[k], gains[k], least = (row + 1) * columns + column + 1, shown[i], lengths[i]
    return views, gains


@kernel(nrt=False)
def _look(
    kept: _Kept,
    robots: int,
    number: int,
    frame: Array,
    factor: int,
    sight: ViewFrame,
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
        for at in range(max(middle_row - sight.around, 0), min(middle_row + sight.around + 1, rows)):
            if at % sight.spacing != 0:
                continue
            for across in range(max(middle_column - sight.around, 0), min(middle_column + sight.around + 1, width)):
                at_row, at_column = frame[0] + at, frame[2] + across
                if across % sight.spacing != 0 or kept.tried[at_row, at_column] == turn or count == len(places):
                    continue
                length = UNREACHED
                for k in range(robots):
                    reached = kept.from_robots[k, (at_row + 1) * columns + at_column + 1]
                    if reached != CLOSED:
                        length = min(length, reached)
                if length == UNREACHED:
                    continue
                place_row, place_column = at_row * factor + factor // 2, at_column * factor + factor // 2
                if not line_is_open(kept.log_odds, place_row, place_column, row, column):
                    continue
                kept.tried[at_row, at_column] = turn
                gain = kept.gains[at_row, at_column]
                if math.isnan(gain):
                    gain = view_gain(kept.log_odds, place_row, place_column, sight)
                    kept.gains[at_row, at_column] = gain
                places[count], shown[count], lengths[count] = at_row * columns + at_column, gain, length
                count += 1
    return count


@kernel
def _nearest(kept: _Kept, robots: int, views: Array, gains: Array, most: int, least_gain: float) -> NDArray[np.int64]:
    """Return the numbers of the frontiers to visit, the nearest to any robot first.

    Each robot in turn takes its nearest: a team that is spread out has something to visit everywhere.
    """
    count = len(views)
    lengths, turns = np.full((robots, count), UNREACHED, np.int64), np.full(count, UNREACHED, np.int64)
    nearest = np.full(count, UNREACHED, np.int64)
    for k in range(robots):
        for i in range(count):
            if views[i] >= 0 and kept.from_robots[k, views[i]] != CLOSED and gains[i] >= least_gain:
                lengths[k, i] = kept.from_robots[k, views[i]]
                nearest[i] = min(nearest[i], lengths[k, i])
        order = np.argsort(lengths[k], kind="mergesort")
        for rank in range(count):
            if lengths[k, order[rank]] != UNREACHED:
                turns[order[rank]] = min(turns[order[rank]], rank * robots + k)
    order = np.argsort(turns, kind="mergesort")[:most]
    chosen = np.sort(order[turns[order] < UNREACHED])
    return chosen[np.argsort(nearest[chosen], kind="mergesort")]


@kernel
def _lengths_between(kept: _Kept, places: Array, starts: Array, side: float, between: Array) -> NDArray[np.int64]:
    """Write the lengths of paths between places (n, n) [m]; return the number of the field of each place.

    Fields reach all robots' starts and the places that follow: paths have the same length in both directions.
    """
    count, columns = len(places), kept.is_open.shape[1]
    slots, is_used = np.full(count, -1, np.int64), np.zeros(len(kept.slots), np.bool_)
    for i in range(count):
        for slot in range(len(kept.slots)):
            if kept.slots[slot, 0] == places[i] and not is_used[slot]:
                slots[i], is_used[slot] = slot, True
                break
    targets = np.empty(len(starts) + count, np.int64)
    targets[: len(starts)] = starts
    free = 0
    for i in range(count):
        if slots[i] < 0:
            while is_used[free]:
                free += 1
            slots[i], is_used[free] = free, True
            kept.slots[free, 0], kept.slots[free, 1] = places[i], 1
            begin_field(kept.fields[free], kept.is_open, kept.bounds, places[i])
        field = kept.fields[slots[i]]
        number = len(starts)
        for j in range(i + 1, count):
            targets[number] = places[j]
            number += 1
        kept.slots[slots[i], 1] = extend_field(
            field, columns, kept.bounds, kept.slots[slots[i], 1], targets[:number], kept.queues
        )
        between[i, i] = 0.0
        for j in range(i + 1, count):
            between[i, j] = between[j, i] = _metres(field[places[j]], side)
    for slot in range(len(kept.slots)):
        if not is_used[slot]:
            kept.slots[slot, 0] = -1
    return slots


@kernel(nrt=False)
def _metres(length: int, side: float) -> float:
    """Return a length of a field in metres."""
    metres: float = NO_PATH if length in (CLOSED, UNREACHED) else (length - 1) * (side / STRAIGHT)
    return metres


@kernel(nrt=False)
def _turn(field: Array, columns: int, pose: Array, start: Array, frame: Array, rules: PlanRules) -> float:
    """Return by how much a robot turns to set out to the start of a field [rad]."""
    reach = max(round(AHEAD / rules.side), 1)
    low_row, low_column = max(start[0] - reach, frame[0]), max(start[1] - reach, frame[2])
    least, at_row, at_column = np.int64(UNREACHED), low_row, low_column
    for row in range(low_row, min(start[0] + reach + 1, frame[1])):
        for column in range(low_column, min(start[1] + reach + 1, frame[3])):
            length = field[(row + 1) * columns + column + 1]
            if length != CLOSED and length < least:
                least, at_row, at_column = np.int64(length), row, column
    factor = rules.factor
    x = (at_column + 0.5) * factor * rules.resolution - pose[0]
    y = (at_row + 0.5) * factor * rules.resolution - pose[1]
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
