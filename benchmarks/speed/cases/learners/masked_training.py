"""Steps a second of MaskablePPO of sb3-contrib at the level of frontiers, rollouts and updates together."""

import importlib.util
import os
import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager

from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.envs.simulation.kernels.floor_cache import DEFAULT_MIB, SIZE_VARIABLE

CORES = 2
TO_REACH = 3000.0
FLOORS, EPISODES, ROLLOUT, EPOCHS = "set:train:300", 64, 32, 4
ALL_MIB = 3072
"""Memory that holds the tables of all these floors [MiB]."""

WARM_ROLLOUTS = 12
ROBOT = {"level": "frontier", "observe": ["frontiers", "time_left"], "robots": 1, "horizon_s": 60.0}

NOTES = (
    f"*MaskablePPO*: of sb3-contrib, its `MultiInputPolicy`, {EPISODES} episodes of one robot on `{FLOORS}` "
    f"from the store of floors, {ROLLOUT} decisions of each between updates of {EPOCHS} epochs, PyTorch on "
    "one thread and the kernels on two. Steps are decisions, by the clock, floors in the store. *All "
    f"floors in memory*: `{SIZE_VARIABLE}={ALL_MIB}`; usual are {DEFAULT_MIB:g} MiB.",
)


def _is_there() -> bool:
    return all(importlib.util.find_spec(name) is not None for name in ("torch", "sb3_contrib"))


def measure(effort: Effort) -> list[Line]:
    """Measure training with as many floors in memory as usual, and with all of them."""
    name = f"MaskablePPO, {EPISODES} episodes, two cores"
    if not _is_there():
        return [Line(name, "-", 'not measured: pip install "lidarium[rl]"', None, TO_REACH, unit="steps/s")]
    lines = []
    for title, mebibytes in ((name, None), (f"{name}, all floors in memory", ALL_MIB)):
        with _floors_in_memory(mebibytes):
            rate = statistics.median(_rates(effort.rounds))
        lines.append(Line(title, f"{shown(rate)} steps/s", "-", None, TO_REACH, rate, unit="steps/s"))
    return lines


@contextmanager
def _floors_in_memory(mebibytes: int | None) -> Iterator[None]:
    """Let unused floors take so many MiB of memory; as many as usual where None."""
    before = os.environ.get(SIZE_VARIABLE)
    if mebibytes is not None:
        os.environ[SIZE_VARIABLE] = str(mebibytes)
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(SIZE_VARIABLE, None)
        else:
            os.environ[SIZE_VARIABLE] = before


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
        model.learn(WARM_ROLLOUTS * steps)  # floors come into the store, and from it into memory
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
