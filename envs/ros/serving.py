"""The simulated team as robots of ROS 2: scans, odometry and transforms out, commands and goals in."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.onboard.radio.messages import Target
from lidarium.envs.ros.graph import Graph
from lidarium.mapping.files.bags.messages import (
    CLOCK,
    GRID,
    LASER_SCAN,
    ODOMETRY,
    POSE_STAMPED,
    TRANSFORMS,
    TWIST,
    TWIST_STAMPED,
)
from lidarium.mapping.files.bags.reading import frame_of, in_plane
from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.grids.occupancy import FREE, OCCUPIED

MAP_FRAME: Final = "map"
"""The floor's frame."""

BEGINNING_S: Final = 1.0
"""Stamp of the first scan: a time of zero means no time in ROS [s]."""

COMMAND_S: Final = 0.5
"""A robot stops if no command has come for so long, as bases do [s]."""

_MASTER_S = 1.0
"""Wall time after which the driver of a robot may be another one [s]."""

_AGAIN_S = 0.2
"""Wall time after which the last scans are sent again to drivers that are waited for [s]."""

ABSENT_S: Final = 120.0
"""Wall time after which a driver that is waited for has hung [s]."""


@dataclass(slots=True)
class _Driven:
    """The last command to a robot.

    Attributes
    ----------
    velocity : (float, float)
        Speed and turn rate [m/s, rad/s].
    target : Target or None
        Goal, if that is newer than the velocity.
    stamp_s : float
        Simulated time of the command [s].
    master : int
        Publisher of the command, 0 for none.
    heard_s : float
        Wall time of the command [s].
    is_new : bool
        Whether it came since the last step.
    """

    velocity: tuple[float, float] = (0.0, 0.0)
    target: Target | None = None
    stamp_s: float = -math.inf
    master: int = 0
    heard_s: float = -math.inf
    is_new: bool = False


@dataclass(slots=True)
class Served:
    """Counts of a served episode.

    Attributes
    ----------
    steps, scans, commands : int
        Steps run, scans sent, commands taken.
    late_steps : int
        Steps that began later than real time asks.
    wall_s, cpu_s : float
        Wall and CPU time of the steps [s].
    """

    steps: int = 0
    scans: int = 0
    commands: int = 0
    late_steps: int = 0
    wall_s: float = 0.0
    cpu_s: float = 0.0


@dataclass(slots=True)
class TeamServer:
    """Serves an environment that has been reset.

    Parameters
    ----------
    env : ExplorationEnv
        The simulation, at the level of velocities.
    graph : Graph
        The node.
    shows_truth : bool
        Whether ``/map`` is the floor and ``/tf`` has the true poses of the robots. Otherwise both are below
        ``/truth``, so that programs that localize and map can publish theirs.
    counts : Served
        Counts so far.
    """

    env: ExplorationEnv
    graph: Graph
    shows_truth: bool = True
    counts: Served = field(default_factory=Served)
    _driven: list[_Driven] = field(default_factory=list)
    _shares: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        self._driven = [_Driven() for _ in self.env.possible_agents]
        self._shares = 1.0 / self.env.settings.speed_limits
        self.graph.advertise("/clock", CLOCK)
        self.graph.advertise("/tf", TRANSFORMS)
        for robot in self.env.possible_agents:
            self.graph.advertise(f"/{robot}/scan", LASER_SCAN)
            self.graph.advertise(f"/{robot}/odom", ODOMETRY)
            self.graph.subscribe(f"/{robot}/cmd_vel", TWIST, TWIST_STAMPED)
            self.graph.subscribe(f"/{robot}/goal_pose", POSE_STAMPED)
        self._mount()
        self._draw()

    @property
    def time_s(self) -> float:
        """Simulated time as it is published [s]."""
        return BEGINNING_S + self.env.time_s

    def run(
        self,
        speed: float = 1.0,
        *,
        waits: bool = False,
        is_over: Callable[[], bool] = lambda: False,
    ) -> None:
        """Serve until something is over, or all robots have ended.

        Parameters
        ----------
        speed : float
            Simulated seconds in a second; 0 for as many as possible.
        waits : bool
            Whether each step waits for a command for each robot that has a driver. Runs then do not depend on the
            speed of the drivers, and end when these leave.
        """
        period = self.env.settings.time_step / speed if speed > 0.0 else 0.0
        self._publish()
        due, began, cpu = time.monotonic(), time.monotonic(), time.process_time()
        try:
            while self.env.agents and not is_over():
                due = self._pace(due, period)
                if waits and not self._await():
                    break
                self._hear()
                self._step()
                self._publish()
        finally:  # also of Ctrl-C, which is the usual end
            self.counts.wall_s += time.monotonic() - began
            self.counts.cpu_s += time.process_time() - cpu

    def _pace(self, due: float, period: float) -> float:
        """Sleep until a step is due; return when the next is."""
        due += period
        if not period:
            return due
        left = due - time.monotonic()
        if left > 0.0:
            time.sleep(left)
        elif left < -period:
            self.counts.late_steps += 1
            return time.monotonic()
        return due

    def _await(self) -> bool:
        """Wait for a new command for each robot that has a driver; return False if all drivers have left."""
        began = again = time.monotonic()
        while True:
            self._hear()
            has_driver = [self.graph.publishers(f"/{robot}/cmd_vel") > 0 for robot in self.env.possible_agents]
            if any(has_driver):
                if all(driven.is_new for driven, has in zip(self._driven, has_driver, strict=True) if has):
                    return True
            elif self.counts.steps:
                return False
            now = time.monotonic()
            if self.counts.steps and now - began > ABSENT_S:
                return False
            if now - again > _AGAIN_S:
                again = now
                self._publish()
            self.graph.wait(0.02)

    def _hear(self) -> None:
        """Take new commands."""
        for row, robot in enumerate(self.env.possible_agents):
            driven, topic = self._driven[row], f"/{robot}/cmd_vel"
            for message, source, _ in self.graph.take(topic):
                twist = getattr(message, "twist", message)
                velocity = float(twist.linear.x), float(twist.angular.z)
                if not all(map(math.isfinite, velocity)):
                    self.graph.refuse(topic, "nan or infinite")
                elif self._obeys(driven, source, topic):
                    driven.velocity, driven.target = velocity, None
            topic = f"/{robot}/goal_pose"
            for message, source, _ in self.graph.take(topic):
                target = self._target(row, message)
                if target is None:
                    self.graph.refuse(topic, f"not a pose in frame {MAP_FRAME}")
                elif self._obeys(driven, source, topic):
                    driven.target = target

    def _obeys(self, driven: _Driven, source: int, topic: str) -> bool:
        """Whether a robot takes a command: its driver stays the same until it is silent."""
        now = time.monotonic()
        if driven.master not in (0, source) and now - driven.heard_s < _MASTER_S:
            self.graph.refuse(topic, "from a second driver")
            return False
        driven.master, driven.heard_s, driven.stamp_s, driven.is_new = source, now, self.time_s, True
        self.counts.commands += 1
        return True

    def _target(self, row: int, message: Any) -> Target | None:  # noqa: ANN401
        """Return a goal in the robot's map frame, None if it cannot be used."""
        x, y, theta = in_plane(message.pose.position, message.pose.orientation)
        if frame_of(message.header.frame_id) != MAP_FRAME or not all(map(math.isfinite, (x, y, theta))):
            return None
        left, low = self.env.perception.poses.offset(row)
        return Target(x - left, y - low, theta)

    def _step(self) -> None:
        env, driven = self.env, self._driven
        velocities = np.array(
            [each.velocity if self.time_s - each.stamp_s <= COMMAND_S else (0.0, 0.0) for each in driven]
        )
        if any(each.target is not None for each in driven):
            shares = np.clip(velocities * self._shares, -1.0, 1.0)
            env.step({agent: driven[row].target or shares[row] for row, agent in enumerate(env.possible_agents)})
        else:
            env.drive_at(velocities)
            env.outcome()  # robots end in it
        self.counts.steps += 1
        for each in driven:
            each.is_new = False

    def _publish(self) -> None:
        """Publish the current measurements of the robots."""
        env, graph, now = self.env, self.graph, self.time_s
        world, settings = env.world, env.settings
        odometry, tree = env.simulation.dead_reckoning, "/tf" if self.shows_truth else "/truth/tf"
        origins = composed(world.poses, relative(odometry, np.zeros_like(odometry)))
        graph.clock(now)
        for row, robot in enumerate(env.possible_agents):
            odom, base = f"{robot}/odom", f"{robot}/base_link"
            graph.transform(MAP_FRAME, odom, now, origins[row], topic=tree)
            graph.transform(odom, base, now, odometry[row])  # also without the truth: localizers need it
            graph.odometry(f"/{robot}/odom", odom, base, now, odometry[row], tuple(env.simulation.measured[row]))
        if int(world.steps[0]) % settings.scan_steps == 0:
            for row, robot in enumerate(env.possible_agents):
                ranges, lidar = env.simulation.ranges[row], settings.team_lidars[row]
                period = settings.scan_steps * settings.time_step
                graph.scan(f"/{robot}/scan", f"{robot}/laser", now, ranges, lidar, period_s=period)
                self.counts.scans += 1

    def _mount(self) -> None:
        """Publish the poses of the lasers on the robots, in one message: late subscribers get the last one only."""
        mounts = {f"{robot}/base_link": f"{robot}/laser" for robot in self.env.possible_agents}
        self.graph.mounts(mounts, self.time_s, self.env.settings.lidar.height)

    def _draw(self) -> None:
        """Publish the floor as a map."""
        tables = self.env.world.floors[0]
        assert tables is not None
        levels = np.where(tables.laser.solid != 0, OCCUPIED, FREE).astype(np.uint8)
        topic = "/map" if self.shows_truth else "/truth/map"
        self.graph.advertise(topic, GRID)
        self.graph.grid(topic, MAP_FRAME, self.time_s, levels, tables.laser.origin, tables.laser.resolution)
