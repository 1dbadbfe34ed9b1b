"""Decisions a second of PPO with a network that attends to the frontiers on offer."""

import statistics
from dataclasses import replace

from lidarium.benchmarks.speed.cases.learners.masked_training import ALL_MIB, FLOORS, ROBOT, Learner, is_there, timings
from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.extras import install_command

CORES = 2
TO_REACH, TO_REACH_FAST, MOST_SHARE = 2000.0, 1360.0, 0.6
EPISODES, ROLLOUT, BATCH, EPOCHS = 128, 16, 1024, 3

NOTES = (
    "*Attention to frontiers*: `MaskablePPO` with `FrontierPolicy`, whose network has the layers of the "
    f"explorer's, {EPISODES} episodes of one robot on `{FLOORS}`, {ROLLOUT} decisions of each between "
    f"updates of {EPOCHS} epochs, PyTorch and the kernels on two threads, floors as for *MaskablePPO*; *fast* "
    'has `realism="fast"`, and at its target learns from 204,800 decisions in 2.5 minutes.',
)


def measure(effort: Effort) -> list[Line]:
    """Measure decisions a second and the simulator's share: as usual, with all floors in memory, in the fast world."""
    name = "attention to frontiers, two cores"
    if not is_there():
        return [Line(name, "-", f"not measured: {install_command('rl')}", None, TO_REACH, unit="decisions/s")]
    from lidarium.training.reinforcement.frontier_policy import FrontierPolicy

    full = Learner(FrontierPolicy, EPISODES, ROLLOUT, BATCH, EPOCHS, FLOORS, threads=2)
    lines = []
    for title, learner, mebibytes, goal in (
        (name, full, None, TO_REACH),
        (f"{name}, all floors in memory", full, ALL_MIB, TO_REACH),
        (f"{name}, fast", replace(full, world={**ROBOT, "realism": "fast"}), None, TO_REACH_FAST),
    ):
        found = timings(learner, effort.rounds, mebibytes)
        rate, share = (statistics.median(each) for each in zip(*found, strict=True))
        told, part = f"{shown(rate)} decisions/s", f"{title}, the simulator's share"
        lines += [
            Line(title, told, "-", None, goal, rate, unit="decisions/s"),
            Line(part, f"{share:.2f}", "-", None, MOST_SHARE, share, is_upper_bound=True, unit="of the time"),
        ]
    return lines


if __name__ == "__main__":
    run_alone(measure, "Decisions of PPO with attention to frontiers.", CORES)
