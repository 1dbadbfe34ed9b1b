"""Meters on board: distance by wheels, and battery use, of an episode's robots.

Nothing is done in a step where wheels measure exactly and batteries have no limit.
"""

import math

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
        Whose robots; of one episode.
    settings : ExplorationSettings
        Their wheels and batteries.

    Attributes
    ----------
    is_active : bool
        Whether anything has to be done in a step.
    used_j : (robots,) float64
        Energy used since the beginning [J]; 0 where batteries have no limit.
    """

    def __init__(self, world: World, settings: ExplorationSettings) -> None:
        self._world, self._battery, self._time_step = world, settings.battery, settings.time_step
        self._measures_path, self._measures_energy = (
            not settings.odometry.is_ideal,
            settings.battery.is_limited,
        )
        self.is_active = self._measures_path or self._measures_energy
        self.used_j, self._path = np.zeros(settings.robots), np.zeros(settings.robots)
        self.start()

    def start(self) -> None:
        """Begin an episode, after its robots were placed, with full batteries."""
        self.used_j[:], self._path[:], self._taken_in = 0.0, 0.0, 0
        self._remember()

    def _remember(self) -> None:
        self._headings, self._travelled = self._world.poses[:, 2].copy(), self._world.travelled.copy()

    def advance(self) -> None:
        """Take in the last step of the world, if that has not been done."""
        step = int(self._world.steps[0])
        if not self.is_active or step == self._taken_in:
            return
        self._taken_in = step
        if self._measures_path:
            self._path += np.abs(self._world.sensors["velocity"][:, 0]) * self._time_step
        if self._measures_energy:
            self._use_energy()

    def _use_energy(self) -> None:
        world, battery = self._world, self._battery
        turning = np.abs((world.poses[:, 2] - self._headings + math.pi) % (2.0 * math.pi) - math.pi)
        driven = world.travelled - self._travelled
        used = (
            battery.idle_w * self._time_step + battery.per_metre_j * driven + battery.per_radian_j * turning
        )
        # Who has ended is switched off.
        self.used_j += np.where(world.flags & ENDED, 0.0, used)
        self._remember()

    def travelled_m(self, row: int) -> float:
        """Return how far a robot has come as its wheels measure [m]."""
        return float(self._path[row] if self._measures_path else self._world.travelled[row])

    def left_j(self, row: int) -> float | None:
        """Return what is left in a robot's battery [J], None where it has no limit."""
        capacity = self._battery.capacity_j
        return None if capacity is None else max(capacity - float(self.used_j[row]), 0.0)

    @property
    def is_empty(self) -> NDArray[np.bool_]:
        """Which robots have no energy left, (robots,)."""
        capacity = self._battery.capacity_j
        return (
            np.zeros(len(self.used_j), np.bool_) if capacity is None else np.asarray(self.used_j >= capacity)
        )
