"""A driver of teams to their targets.

It plans the robots' paths, keeps them while they are good, and settles who gives way.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.driving.drives import (
    DRIVE_STATES,
    Drives,
    Following,
    drive_state,
    drive_states,
    drop_path,
    follow_teams,
    is_done,
    no_drives,
)
from lidarium.envs.driving.path_following import ARRIVED, BLOCKED, DRIVING, IDLE
from lidarium.envs.driving.planning import (
    TEAMMATE_DISTANCE,
    drive_to,
    prepare_robot,
    prepare_teams_parallel,
    prepare_teams_serial,
)
from lidarium.envs.driving.planning_arrays import Destination, Planning
from lidarium.envs.driving.safety_stop import FORESIGHT_TIMES
from lidarium.envs.driving.traffic import find_refuge, obstructing
from lidarium.envs.onboard.navigation import CLEARANCE_LIMIT
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.radio.messages import DriveState, Orders, Target
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.mapping.kernels.work_queue import new_queue
from lidarium.mapping.planning.clearance import limit_of
from lidarium.mapping.planning.grid_planning import Cell, Disc, Footprint, cells_of, discs_of, passage_of
from lidarium.mapping.planning.search.search_state import Passage

BODY_MARGIN = 0.002
"""Paths keep the body this far from occupied cells [m]."""

PREFERRED_MARGIN = 0.15
"""Paths keep this far off walls where there is room [m]."""

DETOUR = 4.0
"""Most extra cost at which a robot drives round a blocking teammate [m]."""

NEAR = 0.6
"""Teammates within this gap may be what blocks a robot [m]."""

BACKING_STEPS = 10
"""How many steps a robot backs out where a wall blocks it."""

REFUGE_STAY_S = 15.0
"""Longest time that a robot waits aside [s]."""


def footprint_of(radius: float) -> Footprint:
    """Return the footprint by which a robot of this radius plans.

    It just fits through where it must, and keeps off the walls where it can.
    """
    return Footprint(radius + BODY_MARGIN, radius + PREFERRED_MARGIN, 3.0)


class TeamDriver:
    """Drives the robots of all episodes.

    Positions inside are in the frames of the believed poses.

    What most robots do most of the time, keeping to a path or planning one, runs in kernels over many
    episodes. A robot that is blocked or has moved aside concerns its teammates: such episodes are settled one
    by one.

    Parameters
    ----------
    perception : Perception
        What the robots know.
    settings : ExplorationSettings
        The team of every episode.
    shares_map : bool
        Whether robots plan on the team's map, where it reaches them.

    Attributes
    ----------
    drives : Drives
        What every robot's drive is at; row = episode * robots + robot.
    following : Following
        What ``follow_team`` needs beside it.
    held : (rows,) bool
        Robots that stand still whatever their drives are about, and are driven round like those that have
        ended.
    """

    def __init__(
        self, perception: Perception, settings: ExplorationSettings, shares_map: bool = True
    ) -> None:
        self._perception, self._settings, self.shares_map = perception, settings, shares_map
        robot = settings.robot
        self._rows = settings.robots * perception.world.episodes
        self._footprint = footprint_of(robot.radius)
        self.drives: Drives = no_drives(self._rows)
        limits = np.array(
            [
                robot.cruise_speed,
                min(robot.max_turn_rate, 2.0),
                0.8 * robot.max_acceleration,
                settings.time_step,
            ]
        )
        self.following = Following(
            settings.lidar.unit_vectors,
            np.full(settings.robots, robot.radius),
            limits,
            perception.knows_teammates,
            perception.beliefs.contact,
            perception.beliefs.heard,
            np.ones(settings.robots, np.uint8),
            FORESIGHT_TIMES,
        )
        self._commands = np.zeros((self._rows, 2))
        self.held: NDArray[np.bool_] = np.zeros(self._rows, np.bool_)

    def start(self, episode: int = 0) -> None:
        """Begin an episode: no robot has a target."""
        rows, drives = self._team(episode), self.drives
        self._perception.memory.fit(
            max(grid.size for grid in self._perception.beliefs.log_odds[rows]), self._passage.slots
        )
        drives.is_ordered[rows], drives.passing[rows], drives.has_path[rows] = False, -1, False
        drives.states[rows], drives.stood[rows], drives.counts[rows], drives.backing[rows] = IDLE, 0, 0, 0

    def assign(self, rows: NDArray[np.bool_], orders: Orders) -> None:
        """Give robots, those chosen by ``rows`` (rows,), their targets.

        Who has the same one already goes on with it.
        """
        drives = self.drives
        is_same_place = (drives.targets == orders.targets).all(axis=1)
        is_same_heading = (drives.target_headings == orders.headings) | (
            np.isnan(drives.target_headings) & np.isnan(orders.headings)
        )
        is_same = (drives.is_ordered == orders.is_ordered) & (
            ~orders.is_ordered | is_same_place & is_same_heading
        )
        changed = np.flatnonzero(rows & ~is_same)
        drives.is_ordered[changed] = orders.is_ordered[changed]
        drives.targets[changed], drives.target_headings[changed] = (
            orders.targets[changed],
            orders.headings[changed],
        )
        stopped = changed[drives.passing[changed] < 0]
        drives.has_path[stopped], drives.states[stopped], drives.stood[stopped], drives.counts[stopped] = (
            False,
            IDLE,
            0,
            0,
        )

    def orders(self) -> Orders:
        """Return the targets that all robots have; the arrays are the driver's own."""
        return Orders(self.drives.is_ordered, self.drives.targets, self.drives.target_headings)

    def target(self, row: int) -> Target | None:
        """Return where a robot drives to, None where it has no target."""
        if not self.drives.is_ordered[row]:
            return None
        (x, y), heading = self.drives.targets[row].tolist(), float(self.drives.target_headings[row])
        return Target(x, y, None if math.isnan(heading) else heading)

    def states(self) -> NDArray[np.int8]:
        """Return the numbers of what all robots' driving is about, (rows,).

        ``DRIVE_STATES`` names them.
        """
        return np.asarray(drive_states(self.drives))

    def state(self, row: int) -> DriveState:
        """Return what a robot's driving is about."""
        return DRIVE_STATES[int(drive_state(self.drives, row))]

    def is_done(self, row: int) -> bool:
        """Whether a robot with a target waits for its next order."""
        return bool(is_done(self.drives, row))

    def prepare(self, episodes: NDArray[np.int64] | None = None) -> None:
        """Plan and settle conflicts, in all episodes or the given ones.

        Called once per decision, before its steps.
        """
        drives, robots = self.drives, self._settings.robots
        episodes = np.arange(self._perception.world.episodes) if episodes is None else episodes
        has_refuge = (drives.passing.reshape(-1, robots)[episodes] >= 0).any(axis=1)
        simple = episodes[~has_refuge]
        is_blocked = np.zeros(len(simple), np.bool_)
        if len(simple):
            rows = (simple[:, None] * robots + np.arange(robots)).ravel()
            planning = self.planning(
                rows[drives.is_ordered[rows] & (self._perception.world.flags[rows] & ENDED == 0)]
            )
            threads = self._perception.threads_for(len(simple))
            prepare = prepare_teams_parallel if threads > 1 else prepare_teams_serial
            prepare(planning, drives, self._perception.maps, simple, is_blocked, new_queue(), threads)
        for episode in simple[is_blocked]:
            self._settle_team(int(episode))
        for episode in episodes[has_refuge]:
            for row in self._live(int(episode)):
                self._end_refuge(row)
                if drives.passing[row] < 0 and drives.is_ordered[row]:
                    prepare_robot(self._fresh_planning(row), drives, row, 0)
            self._settle_team(int(episode))

    def commands(self) -> NDArray[np.float64]:
        """Return speed and turn rate of all robots for the next step [m/s, rad/s].

        The shape is (rows, 2).
        """
        simulation = self._perception.simulation
        follow_teams(
            self.drives,
            self.following,
            simulation.beliefs.believed,
            simulation.measured,
            simulation.ranges,
            self._commands,
        )
        return self._commands

    def path(self, row: int) -> NDArray[np.float64]:
        """Return the rest of a robot's path, in its map frame, shape (N, 2) [m].

        It begins where the robot is.
        """
        return self._remaining(row) - self._perception.offset(row)

    @property
    def _passage(self) -> Passage:
        """How the robots pass over a map.

        Read-only and shared, so not kept here: copies would be other types to kernels.
        """
        resolution = self._settings.occupancy.resolution
        return passage_of(self._footprint, resolution, limit_of(CLEARANCE_LIMIT, resolution))

    def _team(self, episode: int) -> slice:
        return slice(episode * self._settings.robots, (episode + 1) * self._settings.robots)

    def _teammates(self, row: int) -> list[int]:
        """Return the rows of a robot's teammates, of those that it knows where they are."""
        first, contact = (
            row // self._settings.robots * self._settings.robots,
            self._perception.beliefs.contact[row],
        )
        knows_all = self._perception.knows_teammates
        return [
            first + teammate
            for teammate in range(self._settings.robots)
            if first + teammate != row and (knows_all or contact[teammate])
        ]

    def _live(self, episode: int) -> list[int]:
        team, flags = self._team(episode), self._perception.world.flags
        return [row for row in range(team.start, team.stop) if not flags[row] & ENDED and not self.held[row]]

    def planning(self, rows: NDArray[np.int64], *, with_frontiers: bool = False) -> Planning:
        """Return what planning needs in kernels.

        It has the maps that the given rows plan on, with frontiers if wanted.
        """
        perception, settings, resolution = (
            self._perception,
            self._settings,
            self._settings.occupancy.resolution,
        )
        records, sharing = perception.provide_records(rows, self.shares_map, with_frontiers=with_frontiers)
        world = perception.world
        return Planning(
            settings.robots,
            perception.knows_teammates,
            perception.beliefs.contact,
            perception.beliefs.heard,
            settings.robot.radius,
            resolution,
            self._footprint.radius + 2 * resolution,
            CLEARANCE_LIMIT,
            *self._passage,
            records,
            sharing,
            perception.memory.table,
            perception.beliefs.believed,
            perception.beliefs.origins,
            perception.offsets,
            (world.flags & ENDED != 0) | self.held,
        )

    def _fresh_planning(self, row: int) -> Planning:
        """Return what planning needs for one robot, with its map up to date."""
        self._perception.planning_map(row, self.shares_map)
        return self.planning(np.array([row]))

    def _origin(self, row: int) -> tuple[float, float]:
        origin = self._perception.beliefs.origins[row]
        return float(origin[0]), float(origin[1])

    def _cell(self, row: int) -> Cell:
        place = cells_of(
            self._perception.beliefs.believed[row, :2], self._origin(row), self._settings.occupancy.resolution
        )
        return int(place[0]), int(place[1])

    def _drive_to(
        self,
        row: int,
        goal: Cell,
        avoided: list[int],
        heading: float = math.nan,
        maximum_cost: float = math.inf,
    ) -> bool:
        """Plan a path round the bodies of ``avoided`` and start on it.

        False where there is none.
        """
        chosen = np.zeros(self._settings.robots, np.bool_)
        chosen[np.array(avoided, np.int64) % self._settings.robots] = True
        planning = self._fresh_planning(row)
        destination = Destination(*goal, math.nan, math.nan, heading, maximum_cost)
        return bool(drive_to(planning, self.drives, row, destination, chosen, 0))

    def _remaining(self, row: int) -> NDArray[np.float64]:
        place, count = int(self.drives.places[row]), int(self.drives.counts[row])
        here = self._perception.beliefs.believed[row : row + 1, :2]
        return np.concatenate([here, self.drives.paths[row, place:count]]) if count else here.copy()

    def _end_refuge(self, row: int) -> None:
        """Let a robot that gave way go on.

        This is once the other has passed or enough time has gone by.
        """
        other = int(self.drives.passing[row])
        if other < 0:
            return
        world = self._perception.world
        waited = (
            int(world.steps[row // self._settings.robots] - self.drives.since[row]) * self._settings.time_step
        )
        others_path = self._remaining(other)
        is_past = len(others_path) < 2 or not obstructing(
            self.drives.stations[row], others_path, 2.0 * self._settings.robot.radius + 0.05
        )
        if is_past or waited > REFUGE_STAY_S or world.flags[other] & ENDED:
            self.drives.passing[row] = -1
            drop_path(self.drives, row)

    def _rank(self, row: int) -> int:
        """Return who passes first, lower ranks before higher.

        Who gives way to another has its rank.
        """
        for _ in range(self._settings.robots):
            if self.drives.passing[row] < 0:
                return row
            row = int(self.drives.passing[row])
        return row

    def _settle_team(self, episode: int) -> None:
        """Resolve what blocks robots, one after the other.

        To one that knows of no teammate it is a wall.
        """
        live = self._live(episode)
        for row in live:
            if self.drives.states[row] == BLOCKED:
                self._settle(row, live)

    def _settle(self, row: int, live: list[int]) -> None:
        """Resolve that a teammate blocks a robot.

        It drives round the teammate, or one of the two gives way.
        """
        drives, here = self.drives, self._perception.beliefs.believed[row, :2]
        reach = self._settings.robot.radius + NEAR + self._settings.robot.radius
        near = [
            other
            for other in self._teammates(row)
            if math.dist(here, self._perception.pose_known_to(row, other)[:2]) < reach
        ]
        last = drives.cells[row, drives.counts[row] - 1]
        goal, heading = (int(last[0]), int(last[1])), float(drives.headings[row])
        if not near:
            # A wall, not a robot: back out a little the way it came, and plan anew.
            self._drive_to(row, goal, [], heading)
            drives.backing[row] = BACKING_STEPS
            return
        left = self._remaining(row)
        length = float(np.hypot(*np.diff(left, axis=0).T).sum())
        if self._drive_to(row, goal, near, heading, 1.5 * length + DETOUR):
            return
        movable = [other for other in near if other in live]
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

        False where there is no such place.
        """
        drives, world, distance = (
            self.drives,
            self._perception.world,
            2.0 * self._settings.robot.radius + TEAMMATE_DISTANCE,
        )
        if drives.passing[to] == row or drives.counts[to] == 0:
            return False
        navigation = self._perception.planning_map(row, self.shares_map)
        others = self._teammates(row)
        poses = [self._perception.pose_known_to(row, other) for other in others]
        bodies: list[Disc] = [(float(pose[0]), float(pose[1]), distance) for pose in poses]
        discs = discs_of(bodies, self._origin(row), navigation.resolution)
        cell = find_refuge(
            navigation,
            self._origin(row),
            self._cell(row),
            self._footprint,
            discs,
            self._remaining(to),
            distance + 0.02,
        )
        if cell is None or not self._drive_to(row, cell, others):
            return False
        drives.passing[row], drives.stations[row] = to, self._perception.beliefs.believed[row, :2]
        drives.since[row] = world.steps[row // self._settings.robots]
        drives.stood[to], drives.states[to] = 0, DRIVING
        return True
