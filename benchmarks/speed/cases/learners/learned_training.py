"""Decisions a second of `lidarium train` by rewards: rollouts and updates of the shipped network.

A decision chooses where a robot sets out on its tour, which it then drives for seconds of simulated time.
"""

import importlib.util
import statistics
import tempfile
import time
from pathlib import Path

from lidarium.benchmarks.speed.cases.learners.masked_training import timed
from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.extras import install_command

CORES = 2
TO_REACH, MOST_SHARE = 800.0, 0.6
ENVIRONMENTS, STEPS = 2, 128
TRAINING = f"""
[settings]
resolution = 0.05

[[rounds]]
floors = 1000
kinds = {{ apartment = 0.6, building = 0.4 }}
robots = [1, 1, 2, 3, 4]

[ppo]
decisions = {ENVIRONMENTS * STEPS}
checkpoint = {ENVIRONMENTS * STEPS}
environments = {ENVIRONMENTS}
steps = {STEPS}
batch = 128
"""

NOTES = (
    f"*Training by rewards*: the last phase of `lidarium train`, {ENVIRONMENTS} environments in processes of their "
    f"own, {STEPS} decisions of each between updates. *Simulator's share*: of the time of rollout and update, with one "
    "environment in the same process.",
)


def measure(effort: Effort) -> list[Line]:
    """Measure decisions a second, and how much of the time the simulator takes."""
    names = "training by rewards, two cores", "training by rewards, the simulator's share"
    if importlib.util.find_spec("sb3_contrib") is None:
        missing = f"not measured: {install_command('rl')}"
        return [Line(name, "-", missing, None, goal) for name, goal in zip(names, (TO_REACH, 1), strict=True)]
    rate = statistics.median(1.0 / seconds for seconds, _ in _decisions(effort.rounds, 2))
    share = statistics.median(inside / seconds for seconds, inside in _decisions(1, 1))
    return [
        Line(names[0], f"{shown(rate)} decisions/s", "-", None, TO_REACH, rate, unit="decisions/s"),
        Line(names[1], f"{share:.2f}", "-", None, MOST_SHARE, share, is_upper_bound=True, unit="of the time"),
    ]


def _decisions(rounds: int, workers: int) -> list[tuple[float, float]]:
    """Return of each rollout with its update the seconds a decision, and those within environments."""
    from lidarium.training.reinforcement.learning import environments_of, model_of
    from lidarium.training.reinforcement.masked_ppo import ExplorerPolicy
    from lidarium.training.settings import read_training

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "training.toml")
        path.write_text(TRAINING)
        training = read_training(path)
    environments = environments_of(training, workers)
    inside = timed(environments)
    try:
        model = model_of(ExplorerPolicy, training.ppo, environments, training.seed)
        count = ENVIRONMENTS * STEPS
        model.learn(count)  # kernels and floors come into memory
        found = []
        for _ in range(rounds):
            inside[0], began = 0.0, time.perf_counter()
            model.learn(count, reset_num_timesteps=False)
            found.append(((time.perf_counter() - began) / count, inside[0] / count))
    finally:
        environments.close()
    return found


if __name__ == "__main__":
    run_alone(measure, "Decisions of a training by rewards.", CORES)
