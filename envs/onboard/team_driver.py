"""Drives a team to its targets: plans each robot's path, keeps it while it is good, and settles who gives way."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.driving import (
    ARRIVED,
    BLOCKED,
    DRIVING,
    FORESIGHT_TIMES,
    IDLE,
    MAX_POINTS,
    follow_paths,
)
from lidarium.envs.onboard.perception import NavigationMap, Perception
from lidarium.envs.onboard.state import DriveState, Target
from lidarium.envs.onboard.traffic import Refuge, find_refuge, obstructing
from lidarium.envs.settings import ExplorationSettings
from lidarium.envs.simulation.kinematic import ENDED
from lidarium.mapping.clearance import ClearanceField
from lidarium.mapping.grid_planning import Cell, Disc, Footprint, cells_of, centres_of, discs_of, plan
from lidarium.mapping.path_smoothing import line_keeps_clearance, shortened

BODY_MARGIN = 0.002
"""Paths keep the body this far from occupied cells [m]."""

PREFERRED_MARGIN = 0.15
"""Paths keep this far off walls where there is room [m]."""

DETOUR = 4.0
"""A robot that a teammate blocks drives round it where that costs at most this much more [m]."""

MATE_DISTANCE = 0.06
"""Paths round teammates keep this gap to them [m]."""

NEAR = 0.6
"""Teammates within this gap may be what blocks a robot [m]."""

BACKING_STEPS = 10
"""How many steps a robot backs out where a wall blocks it."""

REFUGE_STAY_S = 15.0
"""Longest time that a robot waits aside [s]."""

_STATES = {IDLE: DriveState.IDLE, DRIVING: DriveState.DRIVING, ARRIVED: DriveState.ARRIVED, BLOCKED: DriveState.BLOCKED}


def footprint_of(radius: float) -> Footprint:
    """Return how a robot of this radius plans: just fitting through where it must, off the walls where it can."""
    return Footprint(radius + BODY_MARGIN, radius + PREFERRED_MARGIN, 3.0)


def _room_beside(points: NDArray[np.int64], clearance: ClearanceField, radius: float) -> NDArray[np.float64]:
    """Return, for each point of a path of cells, the least room beside the body on the piece that leads to it [m]."""
    room = np.zeros(len(points))
    for k in range(len(points)):
        first, last = points[max(k - 1, 0)], points[k]
        steps = int(np.abs(last - first).max()) // 2 + 1
        cells = np.rint(np.linspace(first, last, steps + 1)).astype(np.int64)
        closeness = int(clearance.closeness[cells[:, 0], cells[:, 1]].max())
        room[k] = math.sqrt(max(clearance.limit - closeness, 0)) * 0.5 * clearance.resolution - radius
    return room


class TeamDriver:
    """Drives all robots of a team; positions inside are in the frame of the believed poses.

    Parameters
    ----------
    perception : Perception
        What the robots know.
    settings : ExplorationSettings
        The team.
    shares_map : bool
        Whether robots plan on the team's map, where it reaches them.
    """

    def __init__(self, perception: Perception, settings: ExplorationSettings, shares_map: bool = True) -> None:
        self._perception, self._settings, self.shares_map = perception, settings, shares_map
        robots, robot = settings.robots, settings.robot
        self._footprint = footprint_of(robot.radius)
        self._limits = np.array([robot.cruise_speed, min(robot.max_turn_rate, 2.0), 0.8 * robot.max_acceleration, settings.time_step])
        self._radii = np.full(robots, robot.radius)
        self._unit_vectors = settings.lidar.unit_vectors
        self._targets: list[Target | None] = [None] * robots
        self._cells: list[NDArray[np.int64]] = [np.zeros((0, 2), np.int64)] * robots
        self._refuges: list[Refuge | None] = [None] * robots
        self._has_path = np.zeros(robots, np.bool_)
        self._paths, self._room = np.zeros((robots, MAX_POINTS, 2)), np.zeros((robots, MAX_POINTS))
        self._counts, self._places = np.zeros(robots, np.int64), np.zeros(robots, np.int64)
        self._headings = np.full(robots, math.nan)
        self._states, self._stood = np.zeros(robots, np.int64), np.zeros(robots, np.int64)
        self._backing = np.zeros(robots, np.int64)
        self._commands = np.zeros((robots, 2))
        self._present = np.ones(robots, np.uint8)

    def start(self) -> None:
        """Begin an episode: no robot has a target."""
        for row in range(self._settings.robots):
            self._targets[row], self._refuges[row] = None, None
        self._has_path[:] = False
        self._states[:], self._stood[:], self._counts[:], self._backing[:] = IDLE, 0, 0, 0

    def assign(self, row: int, target: Target | None) -> None:
        """Give a robot its target in its map frame, or None to stay where it is and give way."""
        if target == self._targets[row]:
            if target is not None and self._refuges[row] is None and self._states[row] == ARRIVED:
                return
        else:
            self._targets[row] = target
            if self._refuges[row] is None:
                self._drop_path(row)

    def state(self, row: int) -> DriveState:
        """Return what a robot's driving is about."""
        if self._refuges[row] is not None:
            return DriveState.GIVING_WAY
        if self._targets[row] is not None and not self._has_path[row]:
            return DriveState.NO_PATH
        return _STATES[int(self._states[row])]

    def is_done(self, row: int) -> bool:
        """Whether a robot with a target waits for its next order."""
        return self._targets[row] is not None and self._refuges[row] is None and int(self._states[row]) in (ARRIVED, IDLE)

    def prepare(self) -> None:
        """Plan and settle conflicts; called once per decision, before its steps."""
        live = [row for row in range(self._settings.robots) if not self._perception.world.flags[row] & ENDED]
        for row in live:
            self._end_refuge(row)
            if self._refuges[row] is None and self._targets[row] is not None:
                if self._has_path[row] and not self._path_is_clear(row):
                    self._drop_path(row)
                if not self._has_path[row]:
                    self._plan_to_target(row)
        if self._settings.known_starts:
            for row in live:
                if self._states[row] == BLOCKED:
                    self._settle(row, live)

    def commands(self) -> NDArray[np.float64]:
        """Return speed and turn rate of all robots for the next step, shape (robots, 2) [m/s, rad/s]."""
        world = self._perception.world
        follow_paths(
            world.believed, world.velocities, world.ranges, self._unit_vectors, self._radii, self._limits, self._paths, self._room,
            self._counts, self._places, self._headings, self._states, self._stood, self._backing, self._settings.known_starts,
            self._present, FORESIGHT_TIMES, self._commands,
        )  # fmt: skip
        return self._commands

    def path(self, row: int) -> NDArray[np.float64]:
        """Return what is left of a robot's path, from where it is, in its map frame, shape (N, 2) [m]."""
        return self._remaining(row) - self._perception.offset(row)

    def _navigation(self, row: int) -> NavigationMap:
        shared = self._perception.shared_map() if self.shares_map else None
        return shared if shared is not None else self._perception.own_map(row)

    def _cell(self, row: int) -> Cell:
        world = self._perception.world
        origin = (float(world.origins[row, 0]), float(world.origins[row, 1]))
        place = cells_of(world.believed[row, :2], origin, self._settings.occupancy.resolution)
        return int(place[0]), int(place[1])

    def _origin(self, row: int) -> tuple[float, float]:
        origin = self._perception.world.origins[row]
        return float(origin[0]), float(origin[1])

    def _discs(self, row: int, others: list[int]) -> list[Disc]:
        """Return the bodies of others as discs that this robot's centre must not enter, in cells."""
        believed = self._perception.world.believed
        discs = [(believed[other, 0], believed[other, 1], self._radii[row] + self._radii[other] + MATE_DISTANCE) for other in others]
        return discs_of(discs, self._origin(row), self._settings.occupancy.resolution)

    def _standing(self, row: int) -> list[int]:
        """Return the teammates that stand where they are: ended, without work or waiting."""
        if not self._settings.known_starts:
            return []
        world = self._perception.world
        return [
            other
            for other in range(self._settings.robots)
            if other != row and (world.flags[other] & ENDED or self._states[other] in (IDLE, ARRIVED))
        ]

    def _plan_to_target(self, row: int) -> None:
        target = self._targets[row]
        assert target is not None
        place = np.array([target.x, target.y]) + self._perception.offset(row)
        goal = cells_of(place, self._origin(row), self._settings.occupancy.resolution)
        cell = (int(goal[0]), int(goal[1]))
        heading = math.nan if target.heading is None else target.heading
        standing = self._standing(row)
        if self._drive_to(row, cell, standing, heading, end=place):
            return
        # Only those that have ended can never give way.
        flags = self._perception.world.flags
        ended = [other for other in standing if flags[other] & ENDED]
        if len(ended) < len(standing) and self._drive_to(row, cell, ended, heading, end=place):
            return
        self._has_path[row], self._states[row] = False, IDLE

    def _drive_to(
        self,
        row: int,
        goal: Cell,
        avoided: list[int],
        heading: float = math.nan,
        maximum_cost: float = math.inf,
        end: NDArray[np.float64] | None = None,
    ) -> bool:
        """Plan a path round the bodies of ``avoided`` and start on it; False where there is none."""
        navigation = self._navigation(row)
        rows, columns = navigation.log_odds.shape
        if not (0 <= goal[0] < rows and 0 <= goal[1] < columns):
            return False
        discs = self._discs(row, avoided)
        found = plan(
            navigation.space, navigation.log_odds, navigation.clearance, self._cell(row), goal, self._footprint,
            maximum_cost=maximum_cost, blocked=discs,
        )  # fmt: skip
        if found is None:
            return False
        cells = shortened(found[1], navigation.log_odds, navigation.clearance, self._footprint, discs)[:MAX_POINTS]
        points = centres_of(cells, self._origin(row), navigation.resolution)
        if end is not None and len(points) and np.abs(points[-1] - end).max() <= navigation.resolution:
            # Within the last cell the target itself is as good as the cell's centre where there is room.
            points[-1] = points[-1] if self._is_tight(navigation, cells[-1]) else end
        self._cells[row] = cells
        count = len(cells)
        self._paths[row, :count] = points
        self._room[row, :count] = _room_beside(cells, navigation.clearance, float(self._radii[row]))
        self._counts[row], self._places[row] = count, min(1, count - 1)
        self._headings[row], self._states[row], self._stood[row], self._has_path[row] = heading, DRIVING, 0, True
        return True

    def _is_tight(self, navigation: NavigationMap, cell: NDArray[np.int64]) -> bool:
        return navigation.clearance.at((int(cell[0]), int(cell[1]))) < self._footprint.radius + 2 * navigation.resolution

    def _drop_path(self, row: int) -> None:
        self._has_path[row], self._states[row], self._stood[row], self._counts[row] = False, IDLE, 0, 0

    def _path_is_clear(self, row: int) -> bool:
        """Whether the rest of a path still keeps clear of what is known by now."""
        navigation = self._navigation(row)
        cells = self._cells[row]
        for k in range(max(int(self._places[row]), 1), len(cells)):
            first, last = (int(cells[k - 1][0]), int(cells[k - 1][1])), (int(cells[k][0]), int(cells[k][1]))
            if not line_keeps_clearance(first, last, navigation.log_odds, navigation.clearance, float(self._radii[row])):
                return False
        return True

    def _remaining(self, row: int) -> NDArray[np.float64]:
        place, count = int(self._places[row]), int(self._counts[row])
        here = self._perception.world.believed[row : row + 1, :2]
        return np.concatenate([here, self._paths[row, place:count]]) if count else here.copy()

    def _end_refuge(self, row: int) -> None:
        """Let a robot that gave way go on, once the other has passed or enough time has gone by."""
        refuge = self._refuges[row]
        if refuge is None:
            return
        other = refuge.made_way_for
        world = self._perception.world
        waited = (int(world.steps[0]) - refuge.since_step) * self._settings.time_step
        others_path = self._remaining(other)
        is_past = len(others_path) < 2 or not obstructing(refuge.place, others_path, float(self._radii[row] + self._radii[other]) + 0.05)
        if is_past or waited > REFUGE_STAY_S or world.flags[other] & ENDED:
            self._refuges[row] = None
            self._drop_path(row)

    def _rank(self, row: int) -> int:
        """Return who passes first, lower ranks before higher; who gives way to another has its rank."""
        for _ in range(self._settings.robots):
            refuge = self._refuges[row]
            if refuge is None:
                return row
            row = refuge.made_way_for
        return row

    def _settle(self, row: int, live: list[int]) -> None:
        """Resolve that a teammate stands in a robot's way: drive round it, or one of the two gives way."""
        world = self._perception.world
        reach = self._radii[row] + NEAR
        near = [
            other
            for other in range(self._settings.robots)
            if other != row and math.dist(world.believed[row, :2], world.believed[other, :2]) < reach + self._radii[other]
        ]
        cells = self._cells[row]
        goal = (int(cells[-1][0]), int(cells[-1][1]))
        if not near:
            # A wall, not a robot: back out a little the way it came, and plan anew.
            self._drive_to(row, goal, [], float(self._headings[row]))
            self._backing[row] = BACKING_STEPS
            return
        left = self._remaining(row)
        length = float(np.hypot(*np.diff(left, axis=0).T).sum())
        if self._drive_to(row, goal, near, float(self._headings[row]), 1.5 * length + DETOUR):
            return
        movable = [other for other in near if other in live]
        for other in sorted(movable, key=lambda mate: (self._states[mate] not in (IDLE, ARRIVED), -self._rank(mate))):
            is_idle = self._states[other] in (IDLE, ARRIVED)
            first, second = (other, row) if is_idle or self._rank(other) > self._rank(row) else (row, other)
            if self._give_way(first, second) or self._give_way(second, first):
                return

    def _give_way(self, row: int, to: int) -> bool:
        """Send a robot out of the way of another's path; False where there is no such place."""
        refuge = self._refuges[to]
        if refuge is not None and refuge.made_way_for == row:
            return False
        if self._counts[to] == 0:
            return False
        navigation = self._navigation(row)
        others = [other for other in range(self._settings.robots) if other != row]
        cell = find_refuge(
            navigation, self._origin(row), self._cell(row), self._footprint, self._discs(row, others), self._remaining(to),
            float(self._radii[row] + self._radii[to]) + MATE_DISTANCE + 0.02,
        )  # fmt: skip
        if cell is None or not self._drive_to(row, cell, others):
            return False
        world = self._perception.world
        self._refuges[row] = Refuge(to, world.believed[row, :2].copy(), int(world.steps[0]))
        self._stood[to] = 0
        self._states[to] = DRIVING if self._counts[to] else self._states[to]
        return True
