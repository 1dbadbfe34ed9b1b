"""A driver of teams to their targets.

It plans the robots' paths, keeps them as long as they are clear, and decides which robot gives way.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.driving.drives import (
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
from lidarium.envs.onboard.driving.path_following import DRIVING, IDLE
from lidarium.envs.onboard.driving.path_planner import PathPlanner, footprint_of
from lidarium.envs.onboard.driving.planning import (
    Planning,
    prepare_teams_parallel,
    prepare_teams_serial,
)
from lidarium.envs.onboard.driving.right_of_way import RightOfWay
from lidarium.envs.onboard.driving.safety_stop import FORESIGHT_TIMES
from lidarium.envs.onboard.perception import Perception
from lidarium.envs.onboard.radio.messages import DriveState, Orders, Route, Target
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.mapping.kernels.work_queue import new_work
from lidarium.mapping.planning.search.path_search import check_shape


class TeamDriver:
    """Drives the robots of all episodes.

    Positions inside are in the frames of the believed poses.

    The usual work, following and planning paths, runs in kernels over many
    episodes. A robot that is blocked or has moved aside concerns its teammates: such episodes are settled one
    by one.

    Parameters
    ----------
    perception : Perception
        The beliefs of the robots.
    settings : ExplorationSettings
        The team of every episode.
    shares_map : bool
        Whether robots plan on the team's map, if it reaches them.

    Attributes
    ----------
    drives : Drives
        The drives of all robots; row = episode * robots + robot.
    following : Following
        Further arrays for ``follow_team``.
    planner : PathPlanner
        Planner of the paths.
    """

    def __init__(self, perception: Perception, settings: ExplorationSettings, shares_map: bool = True) -> None:
        self._perception, self._settings, self.shares_map = perception, settings, shares_map
        robot = settings.robot
        self._rows = settings.robots * perception.world.episodes
        self.drives: Drives = no_drives(self._rows)
        perception.poses.attach_targets(self.drives.is_ordered, self.drives.targets)
        self.planner = PathPlanner(perception, settings, self.drives, footprint_of(robot.radius), shares_map)
        self._right_of_way = RightOfWay(perception, settings, self.drives, self.planner)
        limits = np.array(
            [
                robot.cruise_speed,
                min(robot.max_turn_rate, 2.0),
                0.8 * robot.max_acceleration,
                settings.time_step,
            ]
        )
        self.following = Following(
            np.stack([lidar.unit_vectors for lidar in settings.team_lidars]),
            np.full(settings.robots, robot.radius),
            limits,
            perception.poses.knows_teammates,
            perception.beliefs.contact,
            perception.beliefs.heard,
            np.ones(settings.robots, np.uint8),
            FORESIGHT_TIMES,
            perception.simulation.safety,
        )
        self._commands = np.zeros((self._rows, 2))

    def start(self, episode: int = 0) -> None:
        """Begin an episode: no robot has a target."""
        robots, drives = self._settings.robots, self.drives
        rows = slice(episode * robots, (episode + 1) * robots)
        grids = self._perception.beliefs.log_odds[rows]
        for grid in grids:
            check_shape(grid.shape)
        self._perception.memory.fit(max(grid.size for grid in grids), self.planner.passage.slots)
        drives.is_ordered[rows], drives.passing[rows], drives.has_path[rows] = False, -1, False
        drives.is_given[rows] = False
        drives.states[rows], drives.stood[rows], drives.counts[rows], drives.backing[rows] = IDLE, 0, 0, 0

    def assign(self, rows: NDArray[np.bool_], orders: Orders) -> None:
        """Give robots, those chosen by ``rows`` (rows,), their targets.

        A robot that already has this target continues.
        """
        drives = self.drives
        is_same_place = (drives.targets == orders.targets).all(axis=1)
        is_same_heading = (drives.target_headings == orders.headings) | (
            np.isnan(drives.target_headings) & np.isnan(orders.headings)
        )
        is_same = (drives.is_ordered == orders.is_ordered) & (~orders.is_ordered | is_same_place & is_same_heading)
        changed = np.flatnonzero(rows & ~is_same)
        drives.is_ordered[changed], drives.is_given[changed] = orders.is_ordered[changed], False
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

    def follow(self, row: int, route: Route | None) -> None:
        """Let a robot follow a route to its target unchanged; a robot that already follows it continues.

        None leaves it without a path.
        """
        drives = self.drives
        drives.is_given[row] = True
        if drives.passing[row] >= 0:
            return
        if route is None:
            drop_path(drives, row)
            return
        count, points = len(route.points), route.points + self._perception.poses.offset(row)
        heading = math.nan if route.heading is None else route.heading
        if drives.has_path[row] and drives.counts[row] == count:
            has_heading = np.array_equal(drives.headings[row], heading, equal_nan=True)
            if has_heading and np.array_equal(drives.paths[row, :count], points):
                return
        drives.paths[row, :count], drives.room[row, :count] = points, route.room
        drives.counts[row], drives.places[row], drives.headings[row] = count, min(1, count - 1), heading
        drives.states[row], drives.stood[row], drives.has_path[row] = DRIVING, 0, True

    def route_left(self, row: int) -> NDArray[np.float64] | None:
        """Return the rest of the route that a robot follows, from the last point that it has passed.

        It is (P, 2) in its map frame [m]; None without a route.
        """
        drives = self.drives
        if not (drives.is_given[row] and drives.has_path[row]):
            return None
        first = max(int(drives.places[row]) - 1, 0)
        return drives.paths[row, first : drives.counts[row]] - self._perception.poses.offset(row)

    def orders(self) -> Orders:
        """Return the targets that all robots have; the arrays are the driver's own."""
        return Orders(self.drives.is_ordered, self.drives.targets, self.drives.target_headings)

    def target(self, row: int) -> Target | None:
        """Return the target of a robot, None if it has no target."""
        if not self.drives.is_ordered[row]:
            return None
        (x, y), heading = self.drives.targets[row].tolist(), float(self.drives.target_headings[row])
        return Target(x, y, None if math.isnan(heading) else heading)

    def states(self) -> NDArray[np.int8]:
        """Return the numbers of the drive states of all robots, (rows,).

        ``DRIVE_STATES`` names them.
        """
        return np.asarray(drive_states(self.drives))

    def state(self, row: int) -> DriveState:
        """Return the drive state of a robot."""
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
            planning = self.planner.planning(
                rows[drives.is_ordered[rows] & (self._perception.world.flags[rows] & ENDED == 0)]
            )
            threads = self._perception.threads_for(len(simple))
            prepare = prepare_teams_parallel if threads > 1 else prepare_teams_serial
            prepare(planning, drives, self._perception.maps, new_work(simple, threads), is_blocked)
        for episode in simple[is_blocked]:
            self._right_of_way.settle_team(int(episode))
        for episode in episodes[has_refuge]:
            self._right_of_way.end_refuges(int(episode))
            self._right_of_way.settle_team(int(episode))

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
            simulation.beliefs.scanned,
            self._commands,
        )
        return self._commands

    def path(self, row: int) -> NDArray[np.float64]:
        """Return the rest of a robot's path, in its map frame, shape (N, 2) [m].

        It begins at the robot's position.
        """
        return self.planner.remaining(row) - self._perception.poses.offset(row)

    def planning(self, rows: NDArray[np.int64], *, with_frontiers: bool = False) -> Planning:
        """Return the arrays that kernels plan with, see ``PathPlanner``."""
        return self.planner.planning(rows, with_frontiers=with_frontiers)
