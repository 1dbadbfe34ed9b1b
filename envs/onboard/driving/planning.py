"""Path planning for many robots at once, in kernels.

Paths lead to their targets, round teammates, and are planned again if one is blocked.
"""

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.driving.drives import Drives, drop_path
from lidarium.envs.onboard.driving.path_following import ARRIVED, BLOCKED, DRIVING, IDLE, MAX_POINTS
from lidarium.envs.onboard.navigation import COLUMNS, ROWS, closeness_of, log_odds_of
from lidarium.envs.onboard.people_in_sight import BODY_M
from lidarium.envs.onboard.team_maps import TeamMaps, refresh_team
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.work_queue import Work, share_of, take_next
from lidarium.mapping.planning.path_smoothing import kept_places, line_is_clear
from lidarium.mapping.planning.search.path_search import budget_of, find_path
from lidarium.mapping.planning.search.search_state import Passage, Terrain


class Planning(NamedTuple):
    """Robots, maps and world for planning in kernels.

    Attributes
    ----------
    robots : int
        Robots of a team.
    knows_teammates : bool
        Whether all teammates' poses are known at once.
    contact, heard : (rows, robots) uint8, (rows, robots * 3) float64
        If not all poses are known: from which robots each heard lately, and their poses then [m, rad].
    radius : float
        Radius of every body [m].
    resolution : float
        Side of a map cell [m].
    tight : float
        Clearance below which a path ends in the middle of its last cell [m].
    farthest : float
        Clearance is measured up to this [m].
    limit, half_costs, roomy, least_clearance, preferred : as of ``Passage``
        Parameters of a body's passage over a map; written out, because loops on threads take no tuples within tuples.
    records, sharing : (maps, 10) int64 and int
        Records of the maps that the robots plan on, and how many rows share one.
    memory : (pieces, 6) int64
        Scratch of the searches, one for each thread.
    believed, origins, offsets : (rows, 3), (rows, 2), (rows, 2) float64
        Believed poses, lower left corners of the maps and origins of the map frames [m, rad].
    has_ended : (rows,) bool
        Robots that have ended and no longer move.
    people : (people, 2) float64
        People to drive around, in the frame of the believed pose [m]; usually none.
    """

    robots: int
    knows_teammates: bool
    contact: NDArray[np.uint8]
    heard: NDArray[np.float64]
    radius: float
    resolution: float
    tight: float
    farthest: float
    limit: int
    half_costs: NDArray[np.int32]
    roomy: int
    least_clearance: float
    preferred: float
    records: NDArray[np.int64]
    sharing: int
    memory: NDArray[np.int64]
    believed: NDArray[np.float64]
    origins: NDArray[np.float64]
    offsets: NDArray[np.float64]
    has_ended: NDArray[np.bool_]
    people: NDArray[np.float64]


class Destination(NamedTuple):
    """The destination of a robot.

    Attributes
    ----------
    row, column : int
        The cell to go to; outside of the map there is no path.
    x, y : float
        Final position within that cell, if there is room [m]; nan for its centre.
    heading : float
        Wanted heading at the end [rad], nan for any.
    maximum_cost : float
        Maximum cost of the path [m].
    """

    row: int
    column: int
    x: float
    y: float
    heading: float
    maximum_cost: float


TEAMMATE_DISTANCE = 0.06
"""Paths round teammates keep this gap to them [m]."""


@kernel(forceinline=True)
def passage_in(planning: Planning) -> Passage:
    """Return how a body passes over a map (kernel)."""
    return Passage(planning.limit, planning.half_costs, planning.roomy, planning.least_clearance, planning.preferred)


@kernel(nrt=False)
def _place_along(first: int, last: int, step: int, steps: int, is_straight: bool) -> int:
    """Return the cell at one of the steps from a cell to another.

    It is along rows or columns, rounded to even.
    """
    if step == steps:
        return last
    rise = float(last - first)
    way = (step / steps) * rise if is_straight else step * (rise / steps)
    return int(np.rint(way + first))


@kernel(nrt=False)
def _room_before(cells: Array, k: int, closeness: Array, planning: Planning) -> float:
    """Minimum room around the body on the piece of a path that leads to its point k [m]."""
    before = max(k - 1, 0)
    row, column, to_row, to_column = cells[before, 0], cells[before, 1], cells[k, 0], cells[k, 1]
    steps = max(abs(to_row - row), abs(to_column - column)) // 2 + 1
    is_straight = row == to_row or column == to_column
    nearest = 0
    for step in range(steps + 1):
        cell_row = _place_along(row, to_row, step, steps, is_straight)
        cell_column = _place_along(column, to_column, step, steps, is_straight)
        nearest = max(nearest, int(closeness[cell_row, cell_column]))
    return math.sqrt(max(planning.limit - nearest, 0)) * 0.5 * planning.resolution - planning.radius


@kernel
def _discs(planning: Planning, row: int, avoided: Array) -> Array:
    """Return the bodies of the avoided teammates (robots,), and of people, as discs, in cells.

    They are (row, column, radius) and a robot's centre must not enter them.
    """
    first = row // planning.robots * planning.robots
    people = planning.people
    discs = np.empty((avoided.sum() + people.shape[0], 3))
    count = 0
    for teammate in range(planning.robots):
        if avoided[teammate]:
            x, y = planning.believed[first + teammate, 0], planning.believed[first + teammate, 1]
            if not planning.knows_teammates:
                x, y = planning.heard[row, 3 * teammate], planning.heard[row, 3 * teammate + 1]
            discs[count, 0] = (y - planning.origins[row, 1]) / planning.resolution - 0.5
            discs[count, 1] = (x - planning.origins[row, 0]) / planning.resolution - 0.5
            discs[count, 2] = (planning.radius + planning.radius + TEAMMATE_DISTANCE) / planning.resolution
            count += 1
    for person in range(people.shape[0]):
        discs[count, 0] = (people[person, 1] - planning.origins[row, 1]) / planning.resolution - 0.5
        discs[count, 1] = (people[person, 0] - planning.origins[row, 0]) / planning.resolution - 0.5
        discs[count, 2] = (planning.radius + BODY_M + TEAMMATE_DISTANCE) / planning.resolution
        count += 1
    return discs


@kernel
def drive_to(
    planning: Planning, drives: Drives, row: int, destination: Destination, avoided: Array, piece: int
) -> bool:
    """Plan a robot's path round bodies of teammates and start on it (kernel).

    Parameters
    ----------
    avoided : (robots,) bool
        Robots to drive around.
    """
    record, goal = planning.records[row // planning.sharing], (destination.row, destination.column)
    if not (0 <= goal[0] < record[ROWS] and 0 <= goal[1] < record[COLUMNS]):
        return False
    resolution = planning.resolution
    start_row = int(math.floor((planning.believed[row, 1] - planning.origins[row, 1]) / resolution))
    start_column = int(math.floor((planning.believed[row, 0] - planning.origins[row, 0]) / resolution))
    if not (0 <= start_row < record[ROWS] and 0 <= start_column < record[COLUMNS]):
        return False
    discs = _discs(planning, row, avoided)
    terrain = Terrain(log_odds_of(record), closeness_of(record), passage_in(planning), discs)
    budget = budget_of(destination.maximum_cost, resolution)
    cost, path = find_path(terrain, planning.memory[piece], (start_row, start_column), goal, budget)
    if cost < 0:
        return False
    count = _write_points(planning, drives, row, path, terrain)
    _end_within_cell(planning, drives, row, count - 1, terrain.closeness, destination)
    drives.counts[row], drives.places[row] = count, min(1, count - 1)
    drives.headings[row] = destination.heading
    drives.states[row], drives.stood[row], drives.has_path[row] = DRIVING, 0, True
    return True


@kernel
def _write_points(planning: Planning, drives: Drives, row: int, path: Array, terrain: Terrain) -> int:
    """Write the points of a path of cells; return how many.

    Straight lines can join them.
    """
    kept = kept_places(path, terrain)
    count = min(len(kept), MAX_POINTS)
    cells, points = drives.cells[row], drives.paths[row]
    for k in range(count):
        cells[k, 0], cells[k, 1] = path[kept[k], 0], path[kept[k], 1]
        points[k, 0] = (cells[k, 1] + 0.5) * planning.resolution + planning.origins[row, 0]
        points[k, 1] = (cells[k, 0] + 0.5) * planning.resolution + planning.origins[row, 1]
        drives.room[row, k] = _room_before(cells, k, terrain.closeness, planning)
    return count


@kernel(nrt=False)
def _end_within_cell(
    planning: Planning, drives: Drives, row: int, last: int, closeness: Array, destination: Destination
) -> None:
    """Move the last point of a path to the target itself if there is room.

    Within the last cell the target is as good as the cell's centre there.
    """
    cells, points, resolution = drives.cells[row], drives.paths[row], planning.resolution
    if max(abs(points[last, 0] - destination.x), abs(points[last, 1] - destination.y)) <= resolution:
        squared = planning.limit - int(closeness[cells[last, 0], cells[last, 1]])
        if min(math.sqrt(squared) * 0.5 * resolution, planning.farthest) >= planning.tight:
            points[last, 0], points[last, 1] = destination.x, destination.y


@kernel(nrt=False)
def _path_is_clear(planning: Planning, drives: Drives, row: int) -> bool:
    """Whether the rest of a robot's path is still clear on the current map."""
    record = planning.records[row // planning.sharing]
    log_odds, closeness, cells = log_odds_of(record), closeness_of(record), drives.cells[row]
    needed = planning.radius / planning.resolution
    for k in range(max(drives.places[row], 1), drives.counts[row]):
        if not line_is_clear(
            log_odds,
            closeness,
            planning.limit,
            cells[k - 1, 0],
            cells[k - 1, 1],
            cells[k, 0],
            cells[k, 1],
            needed,
        ):
            return False
    return True


@kernel
def prepare_robot(planning: Planning, drives: Drives, row: int, piece: int) -> None:
    """Drop a robot's path that is not clear, and plan one if it has none.

    The plan leads to its target; a path that was given is kept (kernel).
    """
    if drives.passing[row] >= 0 or not drives.is_ordered[row] or drives.is_given[row]:
        return
    if drives.has_path[row]:
        if _path_is_clear(planning, drives, row):
            return
        drop_path(drives, row)
    drives.states[row] = IDLE
    record = planning.records[row // planning.sharing]
    place_x = drives.targets[row, 0] + planning.offsets[row, 0]
    place_y = drives.targets[row, 1] + planning.offsets[row, 1]
    goal_row = math.floor((place_y - planning.origins[row, 1]) / planning.resolution)
    goal_column = math.floor((place_x - planning.origins[row, 0]) / planning.resolution)
    if not (0.0 <= goal_row < record[ROWS] and 0.0 <= goal_column < record[COLUMNS]):
        return
    destination = Destination(int(goal_row), int(goal_column), place_x, place_y, drives.target_headings[row], np.inf)
    avoided, ended = _standing(planning, drives, row)
    # First plan round all standing robots; if that fails, only round those that have ended and never give way.
    for _ in range(2):
        if drive_to(planning, drives, row, destination, avoided, piece):
            return
        if ended.sum() == avoided.sum():
            return
        avoided = ended


@kernel
def _standing(planning: Planning, drives: Drives, row: int) -> tuple[Array, Array]:
    """Return which teammates stand still, and which of them for good, (robots,) bool each."""
    first = row // planning.robots * planning.robots
    avoided, ended = np.zeros(planning.robots, np.bool_), np.zeros(planning.robots, np.bool_)
    for teammate in range(planning.robots):
        other = first + teammate
        if other != row and (planning.knows_teammates or planning.contact[row, teammate] != 0):
            ended[teammate] = planning.has_ended[other]
            avoided[teammate] = ended[teammate] or drives.states[other] == IDLE or drives.states[other] == ARRIVED
    return avoided, ended


@kernel
def prepare_teams_serial(planning: Planning, drives: Drives, maps: TeamMaps, work: Work, is_blocked: Array) -> None:
    """Prepare the live robots of some teams, in their order, on fresh maps.

    The items of the work are episodes; it is noted if a robot is blocked.
    """
    for piece in range(work.first, work.first + work.threads):
        k = take_next(work.taken)
        while k < len(work.items):
            first = work.items[k] * planning.robots
            is_fresh = False
            for row in range(first, first + planning.robots):
                if planning.has_ended[row]:
                    continue
                if drives.is_ordered[row] and drives.passing[row] < 0:
                    if not is_fresh:
                        refresh_team(maps, work.items[k])
                        is_fresh = True
                    prepare_robot(planning, drives, row, piece)
                if drives.states[row] == BLOCKED:
                    is_blocked[k] = True
            k = take_next(work.taken)


@kernel(parallel=True)
def prepare_teams_parallel(planning: Planning, drives: Drives, maps: TeamMaps, work: Work, is_blocked: Array) -> None:
    """Prepare teams on threads; see ``prepare_teams_serial``."""
    for thread in numba.prange(work.threads):
        prepare_teams_serial(planning, drives, maps, share_of(work, thread), is_blocked)
