"""Robots of ROS 2 as a world: commands and scans are messages, and ground truth is not available."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.envs.onboard.radio.messages import Target
from lidarium.envs.ros.graph import Graph
from lidarium.envs.ros.robots import Reading, RobotLink
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.odometry import ODOMETRY
from lidarium.envs.simulation.backends import BACKENDS, simulation_of
from lidarium.envs.simulation.kernels.arrays import DEAD, ENDED
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kinematic_world import KinematicWorld
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.files.bags.reading import in_plane
from lidarium.mapping.geometry.rigid import composed, relative

BACKEND = "ros"
"""Name of the world, while robots are driven."""

STALE_S = 0.5
"""A robot whose last scan is older stops, and is not waited for [s]."""

LOST_S = 10.0
"""A robot that is silent for longer is given up [s]."""

_FREE_TO, _OCCUPIED_FROM = 25, 65
"""Cells of a given map that are free and occupied, as map_server has them by default [%]."""


def ground_around(starts: NDArray[np.float64], side_m: float) -> Floor:
    """Return an empty square around starts (robots, 3): the floor is unknown."""
    half = 0.5 * side_m
    (low_x, low_y), (high_x, high_y) = starts[:, :2].min(axis=0) - half, starts[:, :2].max(axis=0) + half
    return Floor("ros", (float(low_x), float(low_y), float(high_x), float(high_y)))


class RosWorld(KinematicWorld):
    """Robots that take commands and send scans as messages of ROS 2; a ``World`` of one episode.

    ``poses`` are estimates, not the truth: those of the transforms in the map's frame or, without these,
    the odometry from the start. True scans are not available, so coverage stays 0.

    Parameters
    ----------
    settings : ExplorationSettings
        The team.
    links : sequence of RobotLink
        Its robots, in order.
    graph : Graph
        The node.
    is_stamped : bool
        Whether commands are ``TwistStamped``.
    sends_goals : bool
        Whether robots drive to goals by themselves; they get no speeds then.
    stale_s : float
        A robot whose last scan is older stops, and is not waited for [s].
    lost_s : float
        Time without scans after which a robot is given up [s].

    Attributes
    ----------
    env : ExplorationEnv or None
        The environment with the robots' targets and beliefs; set by its maker.
    given_map : GivenMap or None
        A map that the robots begin with.
    stale_steps : int
        Steps in which a robot's scan was stale, over all robots.
    """

    def __init__(
        self,
        settings: ExplorationSettings,
        links: Sequence[RobotLink],
        graph: Graph,
        *,
        is_stamped: bool = False,
        sends_goals: bool = False,
        stale_s: float = STALE_S,
        lost_s: float = LOST_S,
    ) -> None:
        # With odometry of their own: without an error it is not kept otherwise.
        super().__init__(settings.team, settings.team_lidars, settings.time_step, 1, ODOMETRY["ideal"], True)
        self.links, self._graph = links, graph
        self._is_stamped, self._sends_goals = is_stamped, sends_goals
        self._stale_s, self._lost_s = stale_s, lost_s
        self._uses_map = settings.localization == "truth"
        self._origins = np.zeros((self.robots, 3))
        self._has_begun = [False] * self.robots
        self._silent_since: list[float | None] = [None] * self.robots
        self._sent: list[Target | None] = [None] * self.robots
        self.stale_steps = 0
        self.given_map: GivenMap | None = None
        self.env: ExplorationEnv | None = None

    def place(
        self,
        episode: int,
        floor: FloorTables,
        starts: NDArray[np.float64],
        free: NDArray[np.bool_],
        seed: int,
    ) -> None:
        """Begin an episode; the robots are not moved."""
        super().place(episode, floor, starts, free, seed)
        self.true_ranges[:] = np.nan
        self._has_begun = [False] * self.robots

    def move_and_sense(
        self,
        commands: NDArray[np.float64],
        *,
        moves_bodies: bool = True,
        runs: NDArray[np.bool_] | None = None,
    ) -> None:
        """Send the commands, and wait for the scans that follow; see ``World``."""
        ended = self.flags & ENDED != 0
        if moves_bodies:
            wanted = np.where(ended[:, None] | (self.moves[:, None] == 0), 0.0, commands)
            limits = self.bodies[:, 1:3]
            for row, velocity in enumerate(np.clip(wanted, -limits, limits)):
                self._command(row, velocity)
        elif self.given_map is not None and self.env is not None:
            self.given_map.write(self.env)
        missing = {row for row in range(self.robots) if not ended[row] and not self.failed[row]}
        # A robot that was silent before is not waited for, unless all were.
        silent = {row for row in missing if self._silent_since[row] is not None}
        hopeful = missing - silent
        until = time.monotonic() + (self._stale_s if hopeful else self.time_step)
        while missing:
            for row in sorted(missing):
                readings = self.links[row].readings()
                if readings:
                    self._sense(row, readings[-1])
                    missing.discard(row)
            left = until - time.monotonic()
            if left <= 0.0 or (hopeful and not missing & hopeful):
                break
            self._graph.wait(min(left, 0.01))
        for row in missing:
            self._go_without(row)

    def close(self) -> None:
        """Stop all robots."""
        for row in range(self.robots):
            self._command(row, None)

    def _command(self, row: int, velocity: NDArray[np.float64] | None) -> None:
        """Send a speed and turn rate, or the target that these lead to; None stops."""
        link = self.links[row]
        if self._sends_goals:
            self._send_goal(row, link, stops=velocity is None)
        else:
            velocity = np.zeros(2) if velocity is None else velocity
            frame = link.base_frame if self._is_stamped else None
            self._graph.velocity(link.names.command, frame, link.stamp_s, (velocity[0], velocity[1]))

    def _send_goal(self, row: int, link: RobotLink, *, stops: bool) -> None:
        """Send a new target of a robot, or its own place if it has none or stops."""
        driver = None if self.env is None else self.env.driver
        if self.env is None or driver is None:
            return
        has_target = self.moves[row] and not self.flags[row] & ENDED and not stops
        target = driver.target(row) if has_target else None
        if target == self._sent[row]:
            return
        self._sent[row] = target
        believed = self.env.beliefs.believed[row]
        x, y, theta = believed.tolist()
        if target is not None:
            x, y = np.array([target.x, target.y]) + self.env.perception.poses.offset(row)
            theta = math.atan2(y - believed[1], x - believed[0]) if target.heading is None else target.heading
        self._graph.goal(link.names.goal, self.map_frame(row), link.stamp_s, (x, y, theta))

    def map_frame(self, row: int) -> str:
        """Return the frame of a robot's believed poses."""
        names = self.links[row].names
        return names.map_frame if self._uses_map else names.own_map_frame

    def odometry_of(self, row: int) -> NDArray[np.float64]:
        """Return a robot's pose in the frame of its odometry, (3,)."""
        return composed(self._origins[row], self.odometry[row])

    def _sense(self, row: int, reading: Reading) -> None:
        """Take the newest reading of a robot."""
        self._silent_since[row] = None
        self.ranges[row] = reading.ranges
        self.measured[row] = self.velocities[row] = reading.velocity
        if not self._has_begun[row]:
            self._origins[row], self._has_begun[row] = reading.odometry, True
        moved = relative(self._origins[row], reading.odometry)
        self.travelled[row] += math.hypot(*(moved - self.odometry[row])[:2])
        self.odometry[row] = moved
        pose = composed(self.starts[row], moved)
        if self._uses_map and reading.mapped is not None:
            pose = reading.mapped
        self.poses[row] = pose

    def _go_without(self, row: int) -> None:
        """Stop a robot without a scan: obstacles ahead are unknown."""
        self.stale_steps += 1
        self.ranges[row] = np.nan
        self._command(row, None)
        # By the time spent waiting: a robot is not silent while its driver thinks.
        since = self._silent_since[row] or time.monotonic() - self._stale_s
        self._silent_since[row] = since
        if time.monotonic() - since > self._lost_s:
            self.failed[row], self.moves[row] = DEAD, 0


class GivenMap:
    """A map that is given in advance, from a topic.

    Parameters
    ----------
    message : object
        An occupancy grid of ROS 2: 0 to 100, -1 for unknown.

    Raises
    ------
    ValueError
        If the message is not a valid grid.
    """

    def __init__(self, message: Any) -> None:  # noqa: ANN401
        info = message.info
        self._cells = np.asarray(message.data, np.int8)
        self._side, self._pose = float(info.resolution), in_plane(info.origin.position, info.origin.orientation)
        shape = int(info.height), int(info.width)
        if self._cells.size != shape[0] * shape[1] or not self._cells.size or not 1e-3 <= self._side <= 10.0:
            raise ValueError(
                f"the map has {self._cells.size:,} cells of {self._side:g} m for {shape[0]} x {shape[1]}; want a grid"
            )
        if not np.isfinite(self._pose).all():
            raise ValueError(f"the map lies at {self._pose}; want finite metres")
        self._cells = self._cells.reshape(shape)

    def write(self, env: ExplorationEnv) -> None:
        """Write the map into the beliefs of all robots of an environment, which share its frame."""
        beliefs, side = env.beliefs, env.settings.occupancy.resolution
        # Half as sure as scans can make it, so that they can contradict it.
        free, occupied = (np.int8(bound // 2) for bound in env.settings.occupancy.increments[2:].tolist())
        for row, log_odds in enumerate(beliefs.log_odds):
            y, x = (
                low + (np.arange(count) + 0.5) * side
                for low, count in zip(beliefs.origins[row][::-1], log_odds.shape, strict=True)
            )
            east, north = x[None] - self._pose[0], y[:, None] - self._pose[1]
            cosine, sine = math.cos(self._pose[2]), math.sin(self._pose[2])
            columns = np.floor((cosine * east + sine * north) / self._side).astype(np.int64)
            rows = np.floor((cosine * north - sine * east) / self._side).astype(np.int64)
            inside = (rows >= 0) & (rows < self._cells.shape[0]) & (columns >= 0) & (columns < self._cells.shape[1])
            levels = np.full(log_odds.shape, -1, np.int8)
            levels[inside] = self._cells[rows[inside], columns[inside]]
            known = (levels >= _OCCUPIED_FROM) | ((levels >= 0) & (levels <= _FREE_TO))
            beliefs.forget(row, known, (0, 0))  # notes the change
            log_odds[known] = np.where(levels[known] >= _OCCUPIED_FROM, occupied, free)


@contextmanager
def robots_as_backend(
    make: Callable[[ExplorationSettings], RosWorld],
) -> Iterator[list[RosWorld]]:
    """Let settings name the backend ``ros`` meanwhile; yields the worlds that are made."""
    worlds: list[RosWorld] = []

    def make_simulation(settings: ExplorationSettings, episodes: int = 1) -> Simulation:
        if episodes != 1:
            raise ValueError(f"{episodes} episodes of robots of ROS 2 are wanted; want 1: there is one team")
        worlds.append(make(settings))
        return simulation_of(worlds[-1], settings)

    BACKENDS.register(BACKEND, make_simulation, "robots of ROS 2")
    try:
        yield worlds
    finally:
        BACKENDS.unregister(BACKEND)
