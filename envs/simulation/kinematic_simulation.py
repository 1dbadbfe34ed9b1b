"""The simulation of a kinematic world, each step in one kernel call."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.robots import Robot
from lidarium.envs.simulation.kernels.stepping import step_rows, step_serial
from lidarium.envs.simulation.kinematic_world import KinematicWorld
from lidarium.envs.simulation.simulation import PoseSources, Simulation
from lidarium.mapping.grids.occupancy import OccupancySettings


class KinematicSimulation(Simulation):
    """A kinematic world with beliefs and score, stepped by fused kernels.

    Its results equal those of ``Simulation`` for the same world to the bit: the area seen is worked out once for
    the mask and the map, and an episode's arrays stay in the caches.
    """

    is_fused = True

    @classmethod
    def of_team(
        cls,
        robots: Sequence[Robot],
        lidar: Lidar | Sequence[Lidar],
        occupancy: OccupancySettings,
        time_step: float = 0.1,
        episodes: int = 1,
        **options: Any,  # noqa: ANN401
    ) -> "KinematicSimulation":
        """Return the simulation of a team in a kinematic world of its own."""
        of_world = {
            name: options.pop(name)
            for name in ("odometry", "faults", "horizon_s", "people", "doors")
            if name in options
        }
        pose_sources = PoseSources(
            **{name: options.pop(name) for name in ("localization", "knows_teammates") if name in options}
        )
        has_odometry = pose_sources.localization != "truth"
        world = KinematicWorld(
            robots,
            lidar,
            time_step,
            episodes,
            has_odometry=has_odometry,
            scan_steps=options.get("scan_steps", 1),
            **of_world,
        )
        return cls(world, lidar, occupancy, time_step, pose_sources=pose_sources, **options)

    def step(
        self,
        commands: NDArray[np.float64],
        *,
        moves_bodies: bool = True,
        perceives: bool = True,
        runs: NDArray[np.bool_] | None = None,
    ) -> None:
        """Run a step of all episodes in one call; see ``Simulation.step``."""
        step = step_rows if self._is_parallel and self.use_threads() > 1 else step_serial
        chosen = self._everywhere if runs is None else runs
        step(self._table, self.robots, commands, chosen, moves_bodies, perceives)
        if self.camera is not None:
            # The kernel has counted the step.
            self.camera.take(self.world.steps - 1, runs)
