"""Decisions a second of PPO with a network that attends to the frontiers on offer."""

import statistics

from lidarium.benchmarks.speed.cases.learners.masked_training import ALL_MIB, FLOORS, FrontierLearner, is_there, timings
from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.extras import install_command

CORES = 2
TO_REACH, MOST_SHARE = 2000.0, 0.6
EPISODES, ROLLOUT, BATCH, EPOCHS = 128, 16, 1024, 3

NOTES = (
    "*Attention to frontiers*: `MaskablePPO` with `FrontierPolicy`, whose network has the layers of the "
    f"explorer's, {EPISODES} episodes of one robot on `{FLOORS}`, {ROLLOUT} decisions of each between "
    f"updates of {EPOCHS} epochs, PyTorch and the kernels on two threads, floors as for *MaskablePPO*.",
)


def measure(effort: Effort) -> list[Line]:
    """Measure decisions a second and the simulator's share, floors in memory as usual and all of them."""
    name = "attention to frontiers, two cores"
    if not is_there():
        return [Line(name, "-", f"not measured: {install_command('rl')}", None, TO_REACH, unit="decisions/s")]
    from lidarium.training.reinforcement.frontier_policy import FrontierPolicy

    learner, lines = FrontierLearner(FrontierPolicy, EPISODES, ROLLOUT, BATCH, EPOCHS, threads=2), []
    for title, mebibytes in ((name, None), (f"{name}, all floors in memory", ALL_MIB)):
        found = timings(learner, effort.rounds, mebibytes)
        rate, share = (statistics.median(each) for each in zip(*found, strict=True))
        lines += [
            Line(title, f"{shown(rate)} decisions/s", "-", None, TO_REACH, rate, unit="decisions/s"),
            Line(
                f"{title}, the simulator's share",
                f"{share:.2f}",
                "-",
                None,
                MOST_SHARE,
                share,
                is_upper_bound=True,
                unit="of the time",
            ),
        ]
    return lines


if __name__ == "__main__":
    run_alone(measure, "Decisions of PPO with attention to frontiers.", CORES)
