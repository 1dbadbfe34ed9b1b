"""A whole step of the environment, besides the kernel alone.

Two environments are in the same state and get the same actions. One takes whole steps with observations,
rewards, endings and infos; of the other the kernel alone is called.
"""

import time

import numpy as np

from lidarium.benchmarks.speed.harness.lines import Line, within
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.benchmarks.speed.scenes.floors import BenchFloor, straight_floor, turned_floor
from lidarium.benchmarks.speed.scenes.teams import LIDAR
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings

ROBOTS = 3
ALLOWED = 1.3
_HOLD, _DRAWS = 20, 50

CORES = 1

NOTES = (
    "*Whole step*: `ExplorationEnv.step` of 3 robots with observations (a 256 x 256 crop each), rewards and infos, "
    "over `KinematicWorld.step` in the same state; 720 noisy beams, maps at 2.5 cm.",
)


class Twins:
    """Two environments in the same state, stepped alternately.

    One takes whole steps; of the other the kernel alone is called, some steps at a time.
    """

    def __init__(self, floor: BenchFloor) -> None:
        settings = make_settings(
            robots=ROBOTS, lidar=LIDAR, resolution=floor.resolution, horizon_s=None, stop_coverage=None
        )
        self._whole, self._kernel = (ExplorationEnv(floor.floor(), settings) for _ in range(2))
        limits = np.array([settings.robot.max_speed, settings.robot.max_turn_rate])
        generator = np.random.default_rng(0)
        speeds, turns = (generator.uniform(0.2, 0.9, (_DRAWS, ROBOTS)), generator.uniform(-0.3, 0.3, (_DRAWS, ROBOTS)))
        actions = np.stack([speeds, turns], axis=2).astype(np.float32)
        self._actions = [dict(zip(self._whole.possible_agents, team, strict=True)) for team in actions]
        self._commands = [team.astype(np.float64) * limits for team in actions]
        self._resets = 0

    def run(self, seconds: float) -> tuple[float, float]:
        """Start anew, run for about so long and return the two step times.

        They are the seconds per agent step of the whole and of the kernel.
        """
        for env in (self._whole, self._kernel):
            env.reset(seed=self._resets % 8)
        self._resets += 1
        steps, whole, kernel = 0, 0.0, 0.0
        while steps == 0 or whole + kernel < seconds:
            k = steps // _HOLD % _DRAWS
            began = time.perf_counter()
            for _ in range(_HOLD):
                self._whole.step(self._actions[k])
            between = time.perf_counter()
            for _ in range(_HOLD):
                self._kernel.simulation.step(self._commands[k])
            whole, kernel = whole + between - began, kernel + time.perf_counter() - between
            steps += _HOLD
        if not np.array_equal(self._whole.simulation.world.poses, self._kernel.simulation.world.poses):
            raise RuntimeError("the two environments are not in the same state; their times cannot be compared")
        return whole / (steps * ROBOTS), kernel / (steps * ROBOTS)


def measure(effort: Effort) -> list[Line]:
    """Compare the whole step with the kernel, on both floors."""
    straight = straight_floor()
    lines = []
    for name, floor in (("straight floor", straight), ("floor turned by 17 deg", turned_floor(straight))):
        twins = Twins(floor)
        twins.run(effort.block_s)
        whole, kernel = zip(*(twins.run(2.0 * effort.block_s) for _ in range(effort.rounds)), strict=True)
        title = f"whole `ExplorationEnv.step` of 3 robots, {name}"
        lines.append(within(title, whole, "kernel alone", kernel, ALLOWED))
    return lines


if __name__ == "__main__":
    run_alone(measure, "A whole step of the environment beside the kernel alone.")
