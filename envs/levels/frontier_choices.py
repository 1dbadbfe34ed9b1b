"""Which frontiers are offered to robots, one kernel for a whole batch."""

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.driving.drives import (
    STATE_ARRIVED,
    STATE_GIVING_WAY,
    STATE_NO_PATH,
    Drives,
    drive_state,
)
from lidarium.envs.onboard.driving.planning import Planning, passage_in
from lidarium.envs.onboard.navigation import (
    COLUMNS,
    ROW_LOW,
    ROWS,
    closeness_of,
    flags_of,
    log_odds_of,
    tiles_of,
)
from lidarium.envs.onboard.team_maps import TeamMaps, refresh_team
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.costs import FAR
from lidarium.mapping.kernels.work_queue import Work, take_next
from lidarium.mapping.planning.frontiers.approach import cheapest_views
from lidarium.mapping.planning.frontiers.frontier_map import frontier_clusters, ignore_frontiers_near
from lidarium.mapping.planning.search.path_search import clear_memory, search_all, touched_in
from lidarium.mapping.planning.search.search_state import STRAIGHT
from lidarium.mapping.planning.search.swept_costs import (
    SweptCosts,
    costs_in,
    prepare_costs,
    spread_costs,
    take_costs,
)

RAYS = 64
"""Rays by which a view is measured."""


def ray_directions() -> NDArray[np.float64]:
    """Return the directions of the rays, (RAYS, 2): their share of a cell along rows and along columns."""
    angles = (np.arange(RAYS) + 0.5) * (2.0 * math.pi / RAYS)
    return np.stack([np.sin(angles), np.cos(angles)], axis=1)


@kernel(nrt=False)
def expected_gain(log_odds: Array, row: int, column: int, rays: Array, reach: int) -> float:
    """Return the unknown area in view of a cell [cells], by rays that end at occupied cells.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The map: 0 unknown, above 0 occupied.
    rays : (rays, 2) float64
        See `ray_directions`.
    reach : int
        Range of the rays [cells].
    """
    rows, columns = log_odds.shape
    area = 0.0
    for ray in range(rays.shape[0]):
        along_rows, along_columns = rays[ray, 0], rays[ray, 1]
        for step in range(1, reach + 1):
            at_row = int(math.floor(row + 0.5 + step * along_rows))
            at_column = int(math.floor(column + 0.5 + step * along_columns))
            if not (0 <= at_row < rows and 0 <= at_column < columns):
                break
            level = log_odds[at_row, at_column]
            if level > 0:
                break
            if level == 0:
                area += step
    return float(area * (2.0 * math.pi / rays.shape[0]))


@kernel(nrt=False)
def _rank(values: Array, is_wanted: Array, ranked: Array, first: int, last: int) -> int:
    """Write wanted clusters to ``ranked[first:last]``, the highest value first; return the end of the list.

    The first of equals comes first. Ranked clusters are no longer wanted.
    """
    while first < last:
        best = -1
        for k in range(len(values)):
            if is_wanted[k] and (best < 0 or values[k] > values[best]):
                best = k
        if best < 0:
            break
        is_wanted[best] = False
        ranked[first] = best
        first += 1
    return first


@kernel(nrt=False)
def choose_offers(left: Array, sizes: Array, is_wanted: Array, by_size: int, ranked: Array) -> int:
    """Choose which clusters are offered, and return how many.

    They are the cheapest, and of the others the longest; offered in the order of their cost.

    Parameters
    ----------
    left : (clusters,) array
        Rest of the budget at each cluster: more is cheaper.
    sizes : (clusters,) array
        Size of each cluster.
    is_wanted : (clusters,) bool
        Which may be offered; overwritten.
    ranked : (offers,) int64
        The numbers of the chosen clusters (written).
    """
    count = int(_rank(left, is_wanted, ranked, 0, len(ranked) - by_size))
    if by_size == 0:
        return count
    count = _rank(sizes, is_wanted, ranked, count, len(ranked))
    is_wanted[:] = False
    for i in range(count):
        is_wanted[ranked[i]] = True
    return int(_rank(left, is_wanted, ranked, 0, count))


FARTHEST = 1000.0
"""Largest number in a table of offers [m]."""


MOST_GAIN = 10_000.0
"""Largest gain that is expected of a frontier [m2]."""


PATIENCE_S = 20.0
"""Time without motion after which a robot gives up its frontier [s]."""


MOVED = 0.15
"""Minimum distance that counts as motion [m]."""


UNSEEN, BLOCKED, NO_PROGRESS = 1, 2, 3


class Offers(NamedTuple):
    """Frontiers offered to each robot; row = episode * robots + robot, offers: ``settings.frontiers``.

    Attributes
    ----------
    tables : (rows, offers, 4) float32
        Position along the axes of the map frame from the robot's believed position, cost of the path and size [m] of
        each frontier, cheapest path first, zeros after the last.
    masks : (rows, offers + 1) int8
        1 for allowed choices; the last choice is to stay.
    counts : (rows,) int64
        Number of frontiers.
    targets, headings : (rows, offers, 2), (rows, offers) float64
        Final position in the map frame [m] and heading there [rad], nan for any.
    cells : (rows, offers, 2) int64
        The frontier cell (row, column) to observe.
    gains : (rows, offers) float32
        Area expected to be newly seen at the target [m2]; (0, 0) if not observed.
    """

    tables: NDArray[np.float32]
    masks: NDArray[np.int8]
    counts: NDArray[np.int64]
    targets: NDArray[np.float64]
    headings: NDArray[np.float64]
    cells: NDArray[np.int64]
    gains: NDArray[np.float32]


class Choices(NamedTuple):
    """Frontiers chosen by each robot, and its last progress.

    Attributes
    ----------
    is_chosen : (rows,) bool
        Whether the robot has chosen a frontier.
    targets, headings, cells : (rows, 2), (rows,), (rows, 2)
        Target and heading as they were offered.
    tried : (rows, 2) int64
        Cell of the last frontier that the robot was driving to, -1 for none.
    places, since : (rows, 2), (rows,) float64
        Position [m] and time [s] of its last progress.
    """

    is_chosen: NDArray[np.bool_]
    targets: NDArray[np.float64]
    headings: NDArray[np.float64]
    cells: NDArray[np.int64]
    tried: NDArray[np.int64]
    places: NDArray[np.float64]
    since: NDArray[np.float64]


class ViewReach(NamedTuple):
    """Positions from which robots observe frontiers, and the frontiers that are offered.

    Attributes
    ----------
    spans : (2 k + 1,) int64
        The disc within which a robot is near enough to a frontier cell, see ``disc_spans``.
    reach : float
        Its radius [cells].
    time_step : float
        Length of a step [s].
    least_size : float
        Shorter frontiers are offered only if there is no longer one [m].
    by_size : int
        Number of offers for the longest frontiers, the others are the cheapest.
    rays : (rays, 2) float64
        Directions by which gains are measured.
    range_cells : (robots,) int64
        Range at which each robot sees [cells].
    """

    spans: NDArray[np.int64]
    reach: float
    time_step: float
    least_size: float
    by_size: int
    rays: NDArray[np.float64]
    range_cells: NDArray[np.int64]


class Renewal(NamedTuple):
    """Rows with choices and offers to renew, and the results.

    Attributes
    ----------
    is_live, is_offered : (rows,) bool
        Rows with choices to examine, and rows to offer frontiers.
    reasons : (rows,) int8
        Result: why each robot's chosen frontier was given up, 0 if it was not.
    memory : (pieces, 5) int64
        Scratch of the path costs, one for each thread, see ``SweepMemory``.
    """

    is_live: NDArray[np.bool_]
    is_offered: NDArray[np.bool_]
    reasons: NDArray[np.int8]
    memory: NDArray[np.int64]


@kernel(nrt=False)
def _why_in_vain(planning: Planning, drives: Drives, choices: Choices, row: int, time: float) -> int:
    """Return the reason why a chosen frontier is not worth more driving, or 0.

    The reason is a number. Progress of the robot is recorded.
    """
    state = drive_state(drives, row)
    if state == STATE_ARRIVED:
        return UNSEEN
    if state == STATE_NO_PATH:
        return BLOCKED
    x, y = (
        planning.believed[row, 0] - planning.offsets[row, 0],
        planning.believed[row, 1] - planning.offsets[row, 1],
    )
    cell, tried, place = choices.cells[row], choices.tried[row], choices.places[row]
    is_same = tried[0] == cell[0] and tried[1] == cell[1]
    if not is_same or math.hypot(place[0] - x, place[1] - y) > MOVED or state == STATE_GIVING_WAY:
        tried[0], tried[1], place[0], place[1] = cell[0], cell[1], x, y
        choices.since[row] = time
    elif time - choices.since[row] > PATIENCE_S:
        return NO_PROGRESS
    return 0


@kernel
def _offer(
    planning: Planning,
    view: ViewReach,
    swept: SweptCosts,
    offers: Offers,
    row: int,
    cells: Array,
    starts: Array,
    piece: int,
) -> None:
    """Offer a robot frontier clusters that it can approach and see, see `choose_offers`.

    The cheapest path comes first. ``swept`` holds the costs, prepared for the map.
    """
    table, mask = offers.tables[row], offers.masks[row]
    table[:], mask[:], offers.counts[row] = 0.0, 0, 0
    mask[len(table)] = 1
    if offers.gains.size > 0:
        offers.gains[row] = 0.0
    if len(starts) < 2:
        return
    record, resolution = planning.records[row // planning.sharing], planning.resolution
    log_odds = log_odds_of(record)
    origin_x, origin_y = planning.origins[row, 0], planning.origins[row, 1]
    start_row = int(math.floor((planning.believed[row, 1] - origin_y) / resolution))
    start_column = int(math.floor((planning.believed[row, 0] - origin_x) / resolution))
    if not (0 <= start_row < record[ROWS] and 0 <= start_column < record[COLUMNS]):
        return
    if not spread_costs(swept, start_row, start_column):
        _leave_and_spread(planning, swept, record, start_row, start_column, piece)
    places, costs = cheapest_views(cells, starts, log_odds, swept, view.spans)
    sizes, is_near = np.diff(starts), costs < FAR
    is_long = is_near.copy()
    for k in range(len(is_long)):
        is_long[k] &= sizes[k] * resolution >= view.least_size
    ranked = np.empty(len(table), np.int64)
    count = choose_offers(-costs, sizes, is_long if is_long.any() else is_near, view.by_size, ranked)
    offset_x, offset_y = planning.offsets[row, 0], planning.offsets[row, 1]
    x, y = planning.believed[row, 0] - offset_x, planning.believed[row, 1] - offset_y
    for i in range(count):
        k = ranked[i]
        target_x = (places[k, 1] + 0.5) * resolution + (origin_x - offset_x)
        target_y = (places[k, 0] + 0.5) * resolution + (origin_y - offset_y)
        rise, run = places[k, 2] - places[k, 0], places[k, 3] - places[k, 1]
        offers.targets[row, i, 0], offers.targets[row, i, 1] = target_x, target_y
        offers.headings[row, i] = math.atan2(float(rise), float(run)) if rise != 0 or run != 0 else np.nan
        offers.cells[row, i, 0], offers.cells[row, i, 1] = places[k, 2], places[k, 3]
        cost = costs[k] * (resolution / STRAIGHT)
        table[i, 0], table[i, 1] = (
            min(max(target_x - x, -FARTHEST), FARTHEST),
            min(max(target_y - y, -FARTHEST), FARTHEST),
        )
        table[i, 2], table[i, 3] = (
            min(cost, FARTHEST),
            min(sizes[k] * resolution, FARTHEST),
        )
        mask[i] = 1
        if offers.gains.size > 0:
            reach = view.range_cells[row % planning.robots]
            gain = expected_gain(log_odds, places[k, 0], places[k, 1], view.rays, reach)
            offers.gains[row, i] = min(gain * resolution * resolution, MOST_GAIN)
    offers.counts[row] = count


@kernel
def _leave_and_spread(planning: Planning, swept: SweptCosts, record: Array, row: int, column: int, piece: int) -> None:
    """Find the costs of paths from a cell if the body does not fit.

    It leaves towards cells with no less room. Few robots are in such a place: a search cell by cell is enough.
    """
    memory = planning.memory[piece]
    remaining, parent, count, least = search_all(
        log_odds_of(record), closeness_of(record), passage_in(planning), memory, row, column
    )
    touched = touched_in(memory, record[ROWS], record[COLUMNS])
    take_costs(swept, remaining, parent, touched[:count], least)
    clear_memory(memory, record[ROWS], record[COLUMNS], count)


@kernel
def _give_up(
    planning: Planning,
    maps: TeamMaps,
    drives: Drives,
    view: ViewReach,
    choices: Choices,
    renewal: Renewal,
    episode: int,
) -> None:
    """Give up unreachable or unproductive choices of live robots of a team, on fresh maps."""
    refresh_team(maps, episode)
    time = maps.steps[episode] * view.time_step
    for row in range(episode * planning.robots, (episode + 1) * planning.robots):
        if not (renewal.is_live[row] and choices.is_chosen[row]):
            continue
        renewal.reasons[row] = _why_in_vain(planning, drives, choices, row, time)
        if renewal.reasons[row] != 0:
            record, cell = planning.records[row // planning.sharing], choices.cells[row]
            ignore_frontiers_near(flags_of(record), tiles_of(record), cell[0], cell[1], view.reach)


@kernel
def _prepared(planning: Planning, record: Array, memory: Array) -> SweptCosts:
    """Return the scratch for path costs on a map, once for all robots that plan on it."""
    row_low, row_high, column_low, column_high = record[ROW_LOW:]
    window = (row_low, max(row_high, row_low), column_low, max(column_high, column_low))
    swept: SweptCosts = costs_in(memory, window)
    prepare_costs(swept, log_odds_of(record), closeness_of(record), passage_in(planning))
    return swept


def renew_teams(
    planning: Planning,
    maps: TeamMaps,
    drives: Drives,
    view: ViewReach,
    offers: Offers,
    choices: Choices,
    renewal: Renewal,
    work: Work,
) -> None:
    """Give up unreachable or unproductive choices of the robots, then offer again."""
    for piece in numba.prange(work.threads):
        k = take_next(work.taken)
        while k < len(work.items):
            episode = work.items[k]
            _give_up(planning, maps, drives, view, choices, renewal, episode)
            cells, starts = np.empty((0, 2), np.int64), np.zeros(1, np.int64)
            swept = costs_in(renewal.memory[piece], (0, 0, 0, 0))
            listed = -1
            for row in range(episode * planning.robots, (episode + 1) * planning.robots):
                if not renewal.is_offered[row]:
                    continue
                if listed != row // planning.sharing:
                    listed = row // planning.sharing
                    record = planning.records[listed]
                    cells, starts = frontier_clusters(flags_of(record), tiles_of(record), 1)
                    swept = _prepared(planning, record, renewal.memory[piece])
                _offer(planning, view, swept, offers, row, cells, starts, piece)
            k = take_next(work.taken)
