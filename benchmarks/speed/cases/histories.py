"""The same short drives, run in batches of any size. Sizes differ in how much memory is in use, and in nothing else."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.benchmarks.speed.scenes.floors import BenchFloor, team_poses
from lidarium.benchmarks.speed.scenes.teams import LIDAR
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.envs.simulation.kinematic_simulation import KinematicSimulation
from lidarium.mapping.grids.occupancy import OccupancySettings


@dataclass(frozen=True, eq=False)
class Drives:
    """Short drives of many robots on a floor.

    `tables`: the floor; `robots`: robots of a team; teams do not see each other; `starts` (drives, 3) float64: where
    each drive begins [m, rad]; `commands` (drives, 2) float64: its speed and turn rate [m/s, rad/s]; `steps`: how long
    it takes.
    """

    tables: FloorTables
    robots: int
    starts: NDArray[np.float64]
    commands: NDArray[np.float64]
    steps: int


def drawn_drives(floor: BenchFloor, drives: int, robots: int, steps: int) -> Drives:
    """Draw drives on a floor, at speeds and turn rates as those of ``teams``."""
    generator = np.random.default_rng(0)
    commands = np.column_stack([generator.uniform(0.2, 0.7, drives), generator.uniform(-1.0, 1.0, drives)])
    return Drives(floor.tables(), robots, team_poses(floor, drives // robots, robots), commands, steps)


class Histories:
    """Runs all drives, one batch after the other, on one thread.

    Each batch is put where its drives begin and keeps its maps.
    """

    def __init__(self, drives: Drives, rows: int, resolution: float, maps: int | None = None) -> None:
        self._drives, self._rows = drives, rows
        robots = drives.robots
        self.simulation = simulation = KinematicSimulation.of_team(
            [ROBOTS["kobuki"]] * robots, LIDAR, OccupancySettings(resolution=resolution), 0.1, rows // robots
        )
        for episode in range(simulation.episodes):
            simulation.place(
                episode, drives.tables, drives.starts[episode * robots : (episode + 1) * robots], seed=episode
            )
        if maps is not None:
            simulation.beliefs.belief_rows[:] = np.resize(
                simulation.beliefs.belief_rows[:maps], simulation.beliefs.belief_rows.shape
            )
            simulation.score.mask_rows[:] = np.resize(
                simulation.score.mask_rows[:maps], simulation.score.mask_rows.shape
            )

    @property
    def working_set(self) -> int:
        """Bytes of the maps and masks that the robots write to."""
        simulation = self.simulation
        maps = {int(row[0]): int(row[1] * row[2]) for row in simulation.beliefs.belief_rows}
        masks = {int(row[place]): int(row[3] * row[4] * 8) for row in simulation.score.mask_rows for place in (0, 1)}
        return sum(maps.values()) + sum(masks.values())

    def run(self) -> float:
        """Run all drives once and return the seconds per agent step."""
        simulation, drives, spent = self.simulation, self._drives, 0.0
        for first in range(0, len(drives.starts), self._rows):
            chosen = slice(first, first + self._rows)
            simulation.world.poses[:], simulation.world.velocities[:] = drives.starts[chosen], 0.0
            commands = drives.commands[chosen]
            began = time.perf_counter()
            for _ in range(drives.steps):
                simulation.step(commands)
            spent += time.perf_counter() - began
        return spent / (len(drives.starts) * drives.steps)
