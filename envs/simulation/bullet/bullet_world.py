"""The world of PyBullet: wheels, contact and friction move the bodies.

Sensors, noise and faults are those of the kinematic world.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.faults import NO_FAULTS, FaultSettings
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.odometry import ODOMETRY, OdometrySettings
from lidarium.envs.settings.robots import Robot
from lidarium.envs.simulation.bullet.bodies import Bodies, Motion
from lidarium.envs.simulation.bullet.client import has_display
from lidarium.envs.simulation.kernels.arrays import BROKEN_PHYSICS, BY_PERSON, BY_ROBOT, DEAD, ENDED, MET_PERSON
from lidarium.envs.simulation.kernels.contact import CENTRE_BUMPER, SIDE_BUMPER
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kernels.stepping import disturb_scan, drive, encode, note_approaches, sense, walk
from lidarium.envs.simulation.kinematic_world import KinematicWorld
from lidarium.envs.simulation.people.crowd import Crowd, crowd_of

LEAN = math.radians(2.0)
"""From this on a scan is taken along the tilted plane [rad]."""

_OWN_BODY = 1e-3
"""Distance outside its own body at which a ray begins [m]."""


def scan_leaning(bodies: Bodies, robot: int, lidar: Lidar, ranges: NDArray[np.float32]) -> None:
    """Take the scan of a robot that leans.

    Beams meet the floor, the ground and other robots; they begin at the side of the own body.

    Parameters
    ----------
    ranges : (beams,) float32
        Result: true ranges [m], inf for no return.
    """
    motion, first = bodies.motion(robot), bodies.team[robot].radius + _OWN_BODY
    eye = motion.place + lidar.height * motion.axes[:, 2]
    beams = np.stack([np.cos(lidar.angles), np.sin(lidar.angles)], axis=1) @ motion.axes[:, :2].T
    shares = bodies.rays(eye + first * beams, eye + lidar.range_max * beams)
    ranges[:] = np.where(shares < 1.0, first + shares * (lidar.range_max - first), np.inf)


TILT = math.radians(30.0)
"""A robot that leans by more than this has fallen [rad]."""

AT_PERSON_M, STANDING = 0.005, 0.01
"""A robot in contact and this near to a person touches the person [m]; a slower one stands [m/s]."""

FALL = 0.05
"""A robot that lies by more than this below the ground has fallen [m]."""


class BulletWorld(KinematicWorld):
    """Robots with bodies simulated by PyBullet, and the sensors and faults of the kinematic world; a ``World``.

    Motors drive the wheels at the commanded speeds, within the limits of the drive. Encoders read the actual motion
    of the wheels, so a wheel that slips makes odometry differ from the truth. Scans are those of the kinematic world
    at the body's pose; if a robot leans, rays of PyBullet look along its tilted plane.

    Parameters
    ----------
    robots, lidar, time_step, episodes, odometry, faults, horizon_s, scan_steps, people, doors
        As for ``KinematicWorld``.

    Raises
    ------
    MissingBulletError
        If PyBullet is not installed.
    """

    def __init__(
        self,
        robots: Sequence[Robot],
        lidar: Lidar | Sequence[Lidar],
        time_step: float = 0.1,
        episodes: int = 1,
        odometry: OdometrySettings = ODOMETRY["ideal"],
        faults: FaultSettings = NO_FAULTS,
        horizon_s: float | None = None,
        scan_steps: int = 1,
        people: int = 0,
        doors: float = 0.0,
    ) -> None:
        super().__init__(
            robots, lidar, time_step, episodes, odometry, True, faults, horizon_s, scan_steps, people, doors
        )
        self._scan_steps = scan_steps
        self.team = list(robots)
        self._attitudes = np.zeros((self.robots * episodes, 3))
        self._physics = [Bodies(self.team, time_step) for _ in range(episodes)]
        self._wheel_velocities = np.zeros((self.robots * episodes, 2))

    @property
    def attitudes(self) -> NDArray[np.float64]:
        """Height of the bases above the ground, roll and pitch, (rows, 3) [m, rad]."""
        return self._attitudes

    def bodies_of(self, episode: int) -> Bodies:
        """Return the bodies of an episode in PyBullet."""
        return self._physics[episode]

    def place(
        self,
        episode: int,
        floor: FloorTables,
        starts: NDArray[np.float64],
        free: NDArray[np.bool_],
        seed: int,
    ) -> None:
        """Start an episode; see ``World``."""
        super().place(episode, floor, starts, free, seed)
        if not self._physics[episode].client.is_open:
            self._physics[episode] = Bodies(self.team, self.time_step)
        self._physics[episode].begin(_floor_of(floor), starts)
        crowd = crowd_of(self.population, episode)
        if crowd is not None:
            self._physics[episode].add_crowd(crowd)
        self._attitudes[episode * self.robots : (episode + 1) * self.robots] = 0.0

    def move_and_sense(
        self,
        commands: NDArray[np.float64],
        *,
        moves_bodies: bool = True,
        runs: NDArray[np.bool_] | None = None,
    ) -> None:
        """Drive the robots for one time step, then take their scans; see ``World``."""
        chosen = self._everywhere if runs is None else runs
        if moves_bodies:
            before = self.poses.copy()
            drive(self._table, self.robots, commands, chosen)
            walk(self._table, self.robots, chosen)
            kidnapped = (self.poses != before).any(axis=1)
            for episode in np.flatnonzero(chosen).tolist():
                self._move(episode, kidnapped)
            note_approaches(self._table, self.robots, chosen)
            encode(self._table, self.robots, self._wheel_velocities, chosen)
        sense(self._table, self.robots, chosen)
        self._sense_leaning(chosen & ((self.steps + 1) % self._scan_steps == 0))

    def show(self) -> bool:
        """Show the bodies of the first episode in PyBullet's window; False if there is no display."""
        if not has_display():
            return False
        self._physics[0].close()
        self._physics[0] = Bodies(self.team, self.time_step, is_shown=True)
        return True

    def close(self) -> None:
        """End the servers of all episodes; ``place`` starts new ones."""
        for bodies in self._physics:
            bodies.close()

    def _move(self, episode: int, kidnapped: NDArray[np.bool_]) -> None:
        """Move the bodies of an episode by the wheel speeds from ``drive``."""
        first, bodies = episode * self.robots, self._physics[episode]
        rows = range(first, first + self.robots)
        was_in_contact = self.contacts[first : first + self.robots] != 0
        self.contacts[rows], self.bumpers[rows] = 0, 0
        if (self.failed[rows] == BROKEN_PHYSICS).any():
            return
        crowd = crowd_of(self.population, episode)
        if crowd is not None:
            bodies.move_crowd(crowd)
        speeds = np.zeros((self.robots, 2))
        for robot, row in enumerate(rows):
            if kidnapped[row]:
                bodies.put(robot, self.poses[row])
            if self.moves[row]:
                speeds[robot] = self.team[robot].wheel_speeds(*self._within_limits(row, robot))
        wheels = bodies.step(speeds)
        motions = [bodies.motion(robot) for robot in range(self.robots)]
        if not all(np.isfinite((*motion.place, *motion.velocity)).all() for motion in motions):
            self.failed[rows], self.moves[rows], self.velocities[rows] = BROKEN_PHYSICS, 0, 0.0
            return
        for robot, row in enumerate(rows):
            self._wheel_velocities[row] = self.team[robot].body_motion(*wheels[robot].tolist())
            self._follow(row, motions[robot])
            self._touch(row, bodies.touched(robot))
            self.collisions[row] += self.contacts[row] != 0 and not was_in_contact[robot]
            if crowd is not None:
                self._note_person(row, crowd)

    def _within_limits(self, row: int, robot: int) -> tuple[float, float]:
        """Return the speed and turn rate that the drive aims at in this step, as kernels compute them."""
        body, wanted = self.team[robot], self.driven[row].tolist()
        limits, now = (body.max_speed, body.max_turn_rate), self.velocities[row].tolist()
        gains = (body.max_acceleration * self.time_step, body.max_turn_acceleration * self.time_step)
        speed, turn_rate = (
            velocity + min(max(min(max(want, -limit), limit) - velocity, -gain), gain)
            for want, limit, velocity, gain in zip(wanted, limits, now, gains, strict=True)
        )
        return speed, turn_rate

    def _follow(self, row: int, motion: Motion) -> None:
        """Take over if a body is, and see whether it has fallen."""
        axes = motion.axes
        x, y, height = motion.place.tolist()
        theta = math.atan2(axes[1, 0], axes[0, 0])
        if self.moves[row]:
            self.travelled[row] += math.hypot(x - self.poses[row, 0], y - self.poses[row, 1])
        self.poses[row] = x, y, theta if theta > -math.pi else math.pi
        along = motion.velocity[0] * math.cos(theta) + motion.velocity[1] * math.sin(theta)
        self.velocities[row] = along, motion.turning[2]
        roll, pitch = math.atan2(axes[2, 1], axes[2, 2]), math.asin(min(max(-axes[2, 0], -1.0), 1.0))
        self._attitudes[row] = height, roll, pitch
        if axes[2, 2] < math.cos(TILT) or height < -FALL:
            self.failed[row], self.moves[row] = DEAD, 0

    def _touch(self, row: int, points: list[tuple[float, float]]) -> None:
        """Press the bumpers on the sides on which a body touches something."""
        x, y, theta = self.poses[row].tolist()
        for point_x, point_y in points:
            self.contacts[row] = 1
            side = math.remainder(math.atan2(point_y - y, point_x - x) - theta, 2.0 * math.pi)
            if abs(side) <= CENTRE_BUMPER:
                self.bumpers[row, 1] = 1
            elif abs(side) <= SIDE_BUMPER:
                self.bumpers[row, 0 if side > 0.0 else 2] = 1

    def _note_person(self, row: int, crowd: Crowd) -> None:
        """Note a contact with a person: the robot's own if it drives."""
        gaps = np.hypot(*(crowd.people[:, :2] - self.poses[row, :2]).T) - crowd.people[:, 2]
        is_met = bool(self.contacts[row]) and bool((gaps - self.team[row % self.robots].radius < AT_PERSON_M).any())
        safety = self.population.safety[row]
        if is_met and not safety[MET_PERSON]:
            safety[BY_ROBOT if abs(self.velocities[row, 0]) > STANDING else BY_PERSON] += 1.0
        safety[MET_PERSON] = float(is_met)

    def _sense_leaning(self, chosen: NDArray[np.bool_]) -> None:
        """Take the scans of robots that lean anew, along the tilted planes of their lasers."""
        leaning = np.hypot(self._attitudes[:, 1], self._attitudes[:, 2]) > LEAN
        leaning &= np.repeat(chosen, self.robots) & (self.flags & ENDED == 0)
        for row in np.flatnonzero(leaning).tolist():
            episode, robot = divmod(row, self.robots)
            scan_leaning(self._physics[episode], robot, self.lidars[robot], self.true_ranges[row])
            disturb_scan(self._table, row, self.robots)

    def __getstate__(self) -> dict[str, Any]:
        raise TypeError("an episode in PyBullet cannot be copied; make another environment, and reset it")


def _floor_of(tables: FloorTables) -> Floor:
    """Return the floor of tables; by default the floor of the bodies' cells."""
    if tables.floor is not None:
        return tables.floor
    rows, columns = tables.body.solid.shape
    (x, y), side = tables.body.origin, tables.body.resolution
    return Floor("", (x, y, x + columns * side, y + rows * side), cells=tables.body)
