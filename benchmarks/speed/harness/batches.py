"""Our side of the comparisons of batches. Many teams in one vector environment are driven by drawn commands."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.benchmarks.speed.harness.timing import cores
from lidarium.benchmarks.speed.scenes.floors import BenchFloor
from lidarium.benchmarks.speed.scenes.teams import DRAWS, HOLD, drawn_commands
from lidarium.envs.levels.level import STEPS
from lidarium.mapping.kernels.compilation import available_threads

EPISODES, ROBOTS = 64, 2
OBSERVED = ("scan", "pose", "velocity", "bumper", "egocentric_map")
"""What the robots of the batches observe. Egocentric maps of 64 x 64 cells at the scales 1 and 4."""


def can_use(threads: int) -> bool:
    """Whether that many threads of kernels can run at once here."""
    return min(len(cores()), available_threads()) >= threads


class DrivenBatch:
    """A batch of episodes of 2 robots that drive at drawn commands.

    Each speed and turn rate is held for 2 s.

    `env`: the environment; `agents`: robots of all episodes.
    """

    def __init__(
        self,
        floor: BenchFloor,
        threads: int,
        episodes: int = EPISODES,
        **options: Any,  # noqa: ANN401
    ) -> None:
        chosen = {
            "horizon_s": None,
            "stop_coverage": None,
            "observe": OBSERVED,
            "egocentric_cells": 64,
            "egocentric_scales": (1, 4),
        }
        self.env = lidarium.vector_env(
            episodes, floor.floor(), robots=ROBOTS, threads=threads, copy=False, **{**chosen, **options}
        )
        self.agents = self.env.num_envs
        robot = self.env.settings.robot
        self._limits = np.array([robot.max_speed, robot.max_turn_rate])
        self._modes, self._nobody = np.full(episodes, STEPS, np.int8), np.zeros(self.agents, np.bool_)
        self._count = 0

    def start(self, beginning: int) -> None:
        """Begin all episodes anew. The same ``beginning`` gives the same places and commands."""
        self.env.reset(seed=1000 * beginning)
        self._actions = (drawn_commands(self.agents, beginning) / self._limits).astype(np.float32)
        self._commands = self._actions.astype(np.float64) * self._limits
        self._count = 0

    def step(self) -> None:
        """Take a whole step of the batch.

        It consists of motion, scans, scorer, maps, observations, rewards, endings and infos.
        """
        self.env.step(self._actions[self._draw()])

    def step_kernel(self) -> None:
        """Take the same step by the kernel alone."""
        self.env.engine.run_kernel(self._modes, self._commands[self._draw()], self._nobody)

    @property
    def poses(self) -> NDArray[np.float64]:
        """True poses of all robots, (rows, 3) [m, rad]."""
        return self.env.engine.world.poses

    def _draw(self) -> int:
        """Return which of the drawn commands holds in this step, and count the step."""
        draw = self._count // HOLD % DRAWS
        self._count += 1
        return draw
