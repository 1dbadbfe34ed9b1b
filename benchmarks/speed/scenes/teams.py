"""Our side of the comparisons: robots in the kinematic simulation, driven by drawn commands."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.speed.scenes.floors import BenchFloor, free_poses
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.mapping.grids.occupancy import OccupancySettings

BEAMS, RANGE_MAX = 720, 5.6
LIDAR = Lidar(beams=BEAMS, range_max=RANGE_MAX, noise_floor=0.01, noise_share=0.01)

HOLD = 20
"""Steps for which a robot drives at the same speed and turn rate."""

DRAWS = 50


def drawn_commands(robots: int, seed: int) -> NDArray[np.float64]:
    """Draw speeds and turn rates, shape (DRAWS, robots, 2) [m/s, rad/s]. Each is to be held for ``HOLD`` steps."""
    generator = np.random.default_rng(seed)
    speeds = generator.uniform(0.2, 0.7, (DRAWS, robots))
    turns = generator.uniform(-1.0, 1.0, (DRAWS, robots))
    return np.stack([speeds, turns], axis=2)


class DrivenTeam:
    """Robots that drive at drawn speeds and turn rates.

    Each pair is held for 2 s; robots may drive into walls and each other.
    """

    def __init__(self, floor: BenchFloor, robots: int, lidar: Lidar = LIDAR, scales: tuple[int, ...] = ()) -> None:
        self.robots = robots
        self._floor, self._tables = floor, floor.tables()
        settings = OccupancySettings(resolution=floor.resolution)
        self.simulation = KinematicSimulation.of_team([ROBOTS["kobuki"]] * robots, lidar, settings, scales=scales)
        self._count, self._starts = 0, 0
        self.start()

    def start(self) -> None:
        """Begin anew: blank maps, other places."""
        poses = free_poses(self._floor, self.robots, seed=self._starts)
        self.simulation.place(0, self._tables, poses, seed=self._starts)
        self._commands = drawn_commands(self.robots, self._starts)
        self.simulation.step(self._commands[0], moves_bodies=False)
        self._count = 0
        self._starts = (self._starts + 1) % 8

    @property
    def commands(self) -> NDArray[np.float64]:
        """Speeds and turn rates of the next step, (robots, 2) [m/s, rad/s]."""
        return np.asarray(self._commands[self._count // HOLD % DRAWS])

    def step(self) -> None:
        """Move, sense, score and map, for all robots."""
        self.simulation.step(self.commands)
        self._count += 1


def full_circle(beams: int, reach: float) -> Lidar:
    """Return a noise-free laser that looks all around."""
    return Lidar(beams=beams, field_of_view=2.0 * math.pi, range_max=reach)
