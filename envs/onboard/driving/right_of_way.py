"""Right of way: decides which of two robots that block each other gives way."""

import itertools
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.envs.onboard.driving.drives import Drives, drop_path
from lidarium.envs.onboard.driving.path_following import ARRIVED, BLOCKED, DRIVING, IDLE
from lidarium.envs.onboard.driving.path_planner import PathPlanner
from lidarium.envs.onboard.driving.planning import TEAMMATE_DISTANCE, prepare_robot
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.envs.onboard.people_in_sight import people_in_sight
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import Cell, Disc, Until, centres_of, discs_of, search

FARTHEST_REFUGE = (3.0, 12.0, 40.0)
"""Distances at which a robot searches a position aside, in this order [m]."""

SAMPLE = 0.05
"""Distance between the points at which a path is compared with places [m]."""


def _sampled(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points along a path (N, 2), at most ``SAMPLE`` apart."""
    pieces = [path[:1]]
    for first, last in itertools.pairwise(path):
        count = max(int(np.ceil(np.hypot(*(last - first)) / SAMPLE)), 1)
        pieces.append(first + (last - first) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(pieces)


def obstructing(place: NDArray[np.float64], path: NDArray[np.float64], distance: float) -> bool:
    """Whether a body at a position (2,) is within ``distance`` of a path (N, 2) [m]."""
    return bool((np.hypot(*(_sampled(path) - place).T) < distance).any())


def find_refuge(
    navigation: NavigationMap,
    origin: tuple[float, float],
    start: Cell,
    footprint: Footprint,
    discs: list[Disc],
    path: NDArray[np.float64],
    distance: float,
) -> Cell | None:
    """Find the nearest place that is off another robot's path.

    Parameters
    ----------
    origin : (x, y)
        Its lower left corner [m].
    start : (row, column)
        Cell of the robot.
    discs : list of (row, column, radius)
        Bodies of the others, in cells.
    path : (N, 2) float64
        The path to keep off [m].
    distance : float
        Required distance [m].

    Returns
    -------
    (row, column) or None
        The cell with the lowest path cost; None if no cell is suitable.
    """
    tree = scipy.spatial.cKDTree(_sampled(path))
    for farthest in FARTHEST_REFUGE:
        found = search(
            navigation.space,
            navigation.log_odds,
            navigation.clearance,
            start,
            footprint,
            until=Until(maximum_cost=farthest),
            blocked=discs,
        )
        cells = found.reached()
        if not len(cells):
            return None
        gaps, _ = tree.query(centres_of(cells, origin, navigation.resolution), distance_upper_bound=distance)
        free = cells[np.isinf(gaps)]
        if len(free):
            costs = [found.cost((int(row), int(column))) for row, column in free[:2000]]
            best = free[int(np.argmin(costs))]
            return int(best[0]), int(best[1])
    return None


DETOUR = 4.0
"""Maximum extra cost at which a robot drives round a blocking teammate [m]."""

NEAR = 0.6
"""Maximum gap to a teammate that may block a robot [m]."""

BACKING_S = 1.0
"""Time for which a robot backs out if a wall blocks it [s]."""

REFUGE_STAY_S = 15.0
"""Longest time that a robot waits aside [s]."""


class RightOfWay:
    """Decides which robot gives way if robots of a team block each other.

    Parameters
    ----------
    perception : Perception
        The beliefs of the robots.
    settings : ExplorationSettings
        The team of every episode.
    drives : Drives
        The drives of all robots; row = episode * robots + robot.
    planner : PathPlanner
        Planner of their paths.
    """

    def __init__(
        self, perception: Perception, settings: ExplorationSettings, drives: Drives, planner: PathPlanner
    ) -> None:
        self._perception, self._settings, self._drives, self._planner = perception, settings, drives, planner

    def end_refuges(self, episode: int) -> None:
        """Let robots of a team that gave way continue, if the others have passed."""
        for row in self._live(episode):
            self._end_refuge(row)
            if self._drives.passing[row] < 0 and self._drives.is_ordered[row]:
                prepare_robot(self._planner.fresh_planning(row), self._drives, row, 0)

    def _live(self, episode: int) -> list[int]:
        first, flags = episode * self._settings.robots, self._perception.world.flags
        return [
            row
            for row in range(first, first + self._settings.robots)
            if not flags[row] & ENDED and not self._planner.held[row]
        ]

    def _teammates(self, row: int) -> list[int]:
        """Return the rows of a robot's teammates with known positions."""
        first, contact = (
            row // self._settings.robots * self._settings.robots,
            self._perception.beliefs.contact[row],
        )
        knows_all = self._perception.poses.knows_teammates
        return [
            first + teammate
            for teammate in range(self._settings.robots)
            if first + teammate != row and (knows_all or contact[teammate])
        ]

    def _end_refuge(self, row: int) -> None:
        """Let a robot that gave way continue.

        This is once the other has passed or enough time has gone by.
        """
        other = int(self._drives.passing[row])
        if other < 0:
            return
        world = self._perception.world
        waited = int(world.steps[row // self._settings.robots] - self._drives.since[row]) * self._settings.time_step
        others_path = self._planner.remaining(other)
        is_past = len(others_path) < 2 or not obstructing(
            self._drives.stations[row], others_path, 2.0 * self._settings.robot.radius + 0.05
        )
        if is_past or waited > REFUGE_STAY_S or world.flags[other] & ENDED:
            self._drives.passing[row] = -1
            drop_path(self._drives, row)

    def _rank(self, row: int) -> int:
        """Return the rank of a robot; lower ranks pass first.

        A robot that gives way to another takes its rank.
        """
        for _ in range(self._settings.robots):
            if self._drives.passing[row] < 0:
                return row
            row = int(self._drives.passing[row])
        return row

    def settle_team(self, episode: int) -> None:
        """Resolve blockages of robots, one after the other.

        To one that knows of no teammate it is a wall.
        """
        live = self._live(episode)
        for row in live:
            if self._drives.states[row] == BLOCKED:
                self._settle(row, live)

    def _settle(self, row: int, live: list[int]) -> None:
        """Resolve that a teammate blocks a robot.

        It drives round the teammate, or one of the two gives way.
        """
        drives, here = self._drives, self._perception.beliefs.believed[row, :2]
        reach = self._settings.robot.radius + NEAR + self._settings.robot.radius
        near = [
            other
            for other in self._teammates(row)
            if math.dist(here, self._perception.poses.pose_known_to(row, other)[:2]) < reach
        ]
        last = drives.cells[row, drives.counts[row] - 1]
        goal, heading = (int(last[0]), int(last[1])), float(drives.headings[row])
        left = self._planner.remaining(row)
        length = float(np.hypot(*np.diff(left, axis=0).T).sum())
        people = people_in_sight(self._perception.simulation, row, self._settings.robot.radius + NEAR)
        if not near and len(people):
            # Round a person who stands in the way, if that is not far; otherwise the robot waits.
            if not drives.is_given[row]:
                self._planner.drive_to(row, goal, [], heading, 1.5 * length + DETOUR, people)
            return
        if not near:
            # A wall, not a robot: back out a little along the path by which it came, and plan again.
            if not drives.is_given[row]:
                self._planner.drive_to(row, goal, [], heading)
            drives.backing[row] = max(round(BACKING_S / self._settings.time_step), 1)
            return
        is_planned = not drives.is_given[row]
        if is_planned and self._planner.drive_to(row, goal, near, heading, 1.5 * length + DETOUR):
            return
        movable = [other for other in near if other in live]
        if is_planned and not movable:
            # None of the robots nearby will move again, so a detour may have any length.
            self._planner.drive_to(row, goal, near, heading)
        for other in sorted(
            movable,
            key=lambda teammate: (drives.states[teammate] not in (IDLE, ARRIVED), -self._rank(teammate)),
        ):
            is_idle = drives.states[other] in (IDLE, ARRIVED)
            first, second = (other, row) if is_idle or self._rank(other) > self._rank(row) else (row, other)
            if self._yield_to(first, second) or self._yield_to(second, first):
                return

    def _yield_to(self, row: int, to: int) -> bool:
        """Send a robot out of the way of another's path.

        False if there is no such place.
        """
        drives, world, distance = (
            self._drives,
            self._perception.world,
            2.0 * self._settings.robot.radius + TEAMMATE_DISTANCE,
        )
        if drives.passing[to] == row or drives.counts[to] == 0:
            return False
        navigation = self._perception.planning_map(row, self._planner.shares_map)
        others = self._teammates(row)
        poses = [self._perception.poses.pose_known_to(row, other) for other in others]
        bodies: list[Disc] = [(float(pose[0]), float(pose[1]), distance) for pose in poses]
        discs = discs_of(bodies, self._planner.origin(row), navigation.resolution)
        cell = find_refuge(
            navigation,
            self._planner.origin(row),
            self._planner.cell(row),
            self._planner.footprint,
            discs,
            self._planner.remaining(to),
            distance + 0.02,
        )
        if cell is None or not self._planner.drive_to(row, cell, others):
            return False
        drives.passing[row], drives.stations[row] = to, self._perception.beliefs.believed[row, :2]
        drives.since[row] = world.steps[row // self._settings.robots]
        drives.stood[to], drives.states[to] = 0, DRIVING
        return True
