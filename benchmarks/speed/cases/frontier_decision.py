"""Decisions by frontiers of a batch, rows a second of one core's time, on floors that nobody was trained on.

A row is one decision of one robot: it chooses a frontier that it is offered, drives for up to 2 s, and is
offered frontiers again. Episodes begin anew where they end, which counts as well.
"""

import statistics
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lidarium
from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort

CORES = 1
EPISODES, FLOORS = 16, "set:validation"
WORLDS: dict[str, dict[str, Any]] = {"ideal": {"resolution": 0.05}, "fast": {"realism": "fast"}}
"""Settings by the name of their realism."""

WARM_DECISIONS = 20
"""Decisions before the clock starts: maps are begun then, and most floors are in memory."""

TO_REACH = {("ideal", 1): 3500.0, ("ideal", 3): 3000.0, ("fast", 1): 8000.0, ("fast", 3): 6000.0}
"""Rows a CPU second by realism and size of the team."""

NOTES = (
    f"*Frontier decision*: level `frontier`, {EPISODES} episodes on `{FLOORS}`, maps of 5 cm, the default laser and "
    'observations, one thread; *fast* has `realism="fast"`. Choices are drawn with equal probability. A row is a '
    "decision of one robot, up to 20 steps, new episodes included, in CPU time.",
)


class Choosers:
    """A batch whose robots choose among their frontiers at random."""

    def __init__(
        self,
        robots: int,
        threads: int = 1,
        floors: str | None = None,
        episodes: int | None = None,
        realism: str = "ideal",
    ) -> None:
        self._env = lidarium.vector_env(
            episodes or EPISODES,
            floors or FLOORS,
            level="frontier",
            robots=robots,
            threads=threads,
            copy=False,
            **WORLDS[realism],
        )
        self._generator = np.random.default_rng(0)
        self._masks: NDArray[np.int8] = self._env.reset(seed=0)[0]["action_mask"]
        for _ in range(WARM_DECISIONS):
            self.decide()

    def decide(self) -> int:
        """Take a decision of all robots; return how many took part."""
        chances = self._generator.random(self._masks.shape) * self._masks
        chances[:, -1] *= 1e-6  # to stay only where nothing is offered
        observations, _, _, _, infos = self._env.step(chances.argmax(axis=1))
        self._masks = observations["action_mask"]
        return int(infos["active"].sum())

    def run(self, seconds: float) -> float:
        """Decide for about that many seconds; return the processor's seconds a row."""
        rows, began = 0, time.process_time()
        while rows == 0 or time.process_time() - began < seconds:
            rows += self.decide()
        return (time.process_time() - began) / rows


def measure(effort: Effort) -> list[Line]:
    """Measure teams of one and of three robots, in the full world and in the fast one."""
    lines = []
    for (realism, robots), wanted in TO_REACH.items():
        choosers = Choosers(robots, realism=realism)
        rate = 1.0 / statistics.median(choosers.run(4.0 * effort.block_s) for _ in range(effort.rounds))
        name = f"frontier decision, {EPISODES} episodes x {robots} robot{'s' if robots > 1 else ''}"
        name += ", fast" if realism == "fast" else ""
        unit = "rows/CPU s"
        lines.append(Line(name, f"{shown(rate)} {unit}", "-", None, wanted, figure=rate, unit=unit))
    return lines


if __name__ == "__main__":
    run_alone(measure, "Decisions by frontiers of a batch.", CORES)
