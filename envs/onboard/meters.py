"""Meters on board: distance by wheels and battery use of all robots, row = episode * robots + robot.

Nothing is done in a step if wheels measure exactly and batteries have no limit.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.backend import World
from lidarium.envs.simulation.kernels.arrays import ENDED


class Meters:
    """Odometers and battery gauges.

    Parameters
    ----------
    world : World
        The world with the robots.
    settings : ExplorationSettings
        Their wheels and batteries.

    Attributes
    ----------
    is_active : bool
        Whether a step changes anything.
    used_j : (rows,) float64
        Energy used since the beginning of the episode [J]; 0 if batteries have no limit.
    """

    def __init__(self, world: World, settings: ExplorationSettings) -> None:
        self._world = world
        self._battery = settings.battery
        self._time_step = settings.time_step
        self._robots = settings.robots
        self._measures_path = not settings.odometry.is_ideal
        self._measures_energy = settings.battery.is_limited
        self.is_active = self._measures_path or self._measures_energy
        rows = settings.robots * world.episodes
        self.used_j = np.zeros(rows)
        self._path = np.zeros(rows)
        self._travelled = np.zeros(rows)
        self._taken_in = np.zeros(world.episodes, np.int64)

    def start(self, episode: int = 0) -> None:
        """Begin an episode, after its robots were placed, with full batteries."""
        rows = slice(episode * self._robots, (episode + 1) * self._robots)
        self.used_j[rows] = 0.0
        self._path[rows] = 0.0
        self._taken_in[episode] = 0
        self._travelled[rows] = self._world.travelled[rows]

    def advance(self) -> None:
        """Take in the last step of each episode, if that has not been done."""
        if not self.is_active:
            return
        steps = np.maximum(self._world.steps, 0)
        is_new = steps != self._taken_in
        if not is_new.any():
            return
        elapsed_s = self._time_step * np.maximum(steps - self._taken_in, 0)
        self._taken_in = steps
        rows = np.flatnonzero(np.repeat(is_new, self._robots))
        if self._measures_path:
            self._path[rows] += np.abs(self._world.sensors["velocity"][rows, 0]) * self._time_step
        if self._measures_energy:
            self._use_energy(rows, np.repeat(elapsed_s, self._robots)[rows])

    def _use_energy(self, rows: NDArray[np.int64], elapsed_s: NDArray[np.float64]) -> None:
        world, battery = self._world, self._battery
        travelled = world.travelled[rows]
        # Not by headings: a robot that is put elsewhere has not turned.
        turning = np.abs(world.velocities[rows, 1]) * self._time_step
        driven = travelled - self._travelled[rows]
        used = battery.idle_w * elapsed_s + battery.per_metre_j * driven + battery.per_radian_j * turning
        # Robots that have ended are switched off.
        self.used_j[rows] += np.where(world.flags[rows] & ENDED, 0.0, used)
        self._travelled[rows] = travelled

    def travelled_m(self, row: int) -> float:
        """Return the length of a robot's path as its wheels measure it [m]."""
        return float(self._path[row] if self._measures_path else self._world.travelled[row])

    def left_j(self, row: int) -> float | None:
        """Return the energy that is left in a robot's battery [J], None if it has no limit."""
        capacity = self._battery.capacity_j
        return None if capacity is None else max(capacity - float(self.used_j[row]), 0.0)

    @property
    def is_empty(self) -> NDArray[np.bool_]:
        """Which robots have no energy left, (rows,)."""
        capacity = self._battery.capacity_j
        if capacity is None:
            return np.zeros(len(self.used_j), np.bool_)
        return np.asarray(self.used_j >= capacity)
