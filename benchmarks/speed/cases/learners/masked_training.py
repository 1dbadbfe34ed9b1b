"""Steps a second of MaskablePPO of sb3-contrib at the level of frontiers, rollouts and updates together."""

import importlib.util
import statistics
import time

from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort

CORES = 2
TO_REACH = 3000.0
FLOORS, EPISODES, ROLLOUT, EPOCHS = "set:train:300", 64, 32, 4
ROBOT = {"level": "frontier", "observe": ["frontiers", "time_left"], "robots": 1, "horizon_s": 60.0}

NOTES = (
    f"*MaskablePPO*: of sb3-contrib, its `MultiInputPolicy`, {EPISODES} episodes of one robot on `{FLOORS}` "
    f"from the store of floors, {ROLLOUT} decisions of each between updates of {EPOCHS} epochs, PyTorch on "
    "one thread and the kernels on two. Steps are decisions, by the clock, without the first rollout.",
)


def _is_there() -> bool:
    return all(importlib.util.find_spec(name) is not None for name in ("torch", "sb3_contrib"))


def measure(effort: Effort) -> list[Line]:
    """Measure training, a rollout with its update at a time."""
    name = f"MaskablePPO, {EPISODES} episodes, two cores"
    if not _is_there():
        return [Line(name, "-", 'not measured: pip install "lidarium[rl]"', None, TO_REACH, unit="steps/s")]
    rate = statistics.median(_rates(effort.rounds))
    return [Line(name, f"{shown(rate)} steps/s", "-", None, TO_REACH, rate, unit="steps/s")]


def _rates(rounds: int) -> list[float]:

    import torch
    from sb3_contrib import MaskablePPO
    from stable_baselines3.common.vec_env import VecMonitor

    import lidarium

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        env = VecMonitor(lidarium.sb3_vec_env(EPISODES, FLOORS, **ROBOT))
        model = MaskablePPO("MultiInputPolicy", env, n_steps=ROLLOUT, batch_size=512, n_epochs=EPOCHS, seed=0)
        steps = EPISODES * ROLLOUT
        model.learn(4 * steps)  # floors come into the store, and from it into memory
        rates = []
        for _ in range(rounds):
            began = time.perf_counter()
            model.learn(4 * steps, reset_num_timesteps=False)
            rates.append(4 * steps / (time.perf_counter() - began))
        env.close()
    finally:
        torch.set_num_threads(threads)
    return rates


if __name__ == "__main__":
    run_alone(measure, "Steps of MaskablePPO.", CORES)
