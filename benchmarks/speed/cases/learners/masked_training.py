"""Steps a second of MaskablePPO of sb3-contrib at the level of frontiers, rollouts and updates together."""

import statistics

from lidarium.benchmarks.speed.cases.learners.frontier_learner import (
    ALL_MIB,
    FLOORS,
    FrontierLearner,
    is_there,
    timings,
)
from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.envs.simulation.kernels.floor_cache import DEFAULT_MIB, SIZE_VARIABLE

CORES = 2
TO_REACH = 3000.0
LEARNER = FrontierLearner("MultiInputPolicy", episodes=64, rollout=32, batch=512, epochs=4)

NOTES = (
    f"*MaskablePPO*: of sb3-contrib, its `MultiInputPolicy`, {LEARNER.episodes} episodes of one robot on "
    f"`{FLOORS}` from the store of floors, {LEARNER.rollout} decisions of each between updates of "
    f"{LEARNER.epochs} epochs, PyTorch on one thread and the kernels on two. Steps are decisions, by the "
    f"clock, floors in the store. *All floors in memory*: `{SIZE_VARIABLE}={ALL_MIB}`; usual are "
    f"{DEFAULT_MIB:g} MiB.",
)


def measure(effort: Effort) -> list[Line]:
    """Measure training with as many floors in memory as usual, and with all of them."""
    name = f"MaskablePPO, {LEARNER.episodes} episodes, two cores"
    if not is_there():
        return [Line(name, "-", 'not measured: pip install "lidarium[rl]"', None, TO_REACH, unit="steps/s")]
    lines = []
    for title, mebibytes in ((name, None), (f"{name}, all floors in memory", ALL_MIB)):
        rate = statistics.median(rate for rate, _ in timings(LEARNER, effort.rounds, mebibytes))
        lines.append(Line(title, f"{shown(rate)} steps/s", "-", None, TO_REACH, rate, unit="steps/s"))
    return lines


if __name__ == "__main__":
    run_alone(measure, "Steps of MaskablePPO.", CORES)
