"""Training with masks, by attention and of learned explorers."""

import importlib.util
import os
import statistics
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from lidarium.benchmarks.speed.harness.lines import Line, shown
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort
from lidarium.envs.simulation.kernels.floor_cache import DEFAULT_MIB, SIZE_VARIABLE
from lidarium.extras import install_command

FLOORS, MANY_FLOORS = "set:train:300", "set:train:10000"
ROBOT = {"level": "frontier", "observe": ["frontiers", "time_left"], "robots": 1, "horizon_s": 60.0}
ALL_MIB = 3072
"""Memory that holds the tables of all these floors [MiB]."""

WARM_DECISIONS, TIMED_ROLLOUTS = 25_000, 4


@dataclass(frozen=True, slots=True)
class Learner:
    """A learner of sb3-contrib.

    `policy`: as ``MaskablePPO`` takes it; `episodes`, `rollout`: episodes side by side, and decisions of each between
    two updates; `batch`, `epochs`: decisions of a step of gradients, and how often an update sees all; `threads`: of
    PyTorch; `floors`, `world`: floors and settings of the episodes.
    """

    policy: Any
    episodes: int
    rollout: int
    batch: int
    epochs: int
    floors: str
    threads: int = 1
    world: Mapping[str, Any] = field(default_factory=lambda: ROBOT)


def is_there() -> bool:
    """Whether sb3-contrib and PyTorch are installed."""
    return all(importlib.util.find_spec(name) is not None for name in ("torch", "sb3_contrib"))


def timings(learner: Learner, rounds: int, mebibytes: int | None = None) -> list[tuple[float, float]]:
    """Return decisions a second, and the share of the time within environments, of each round."""
    import torch
    from sb3_contrib import MaskablePPO
    from stable_baselines3.common.logger import Logger
    from stable_baselines3.common.vec_env import VecMonitor

    import lidarium

    threads = torch.get_num_threads()
    torch.set_num_threads(learner.threads)
    try:
        with _floors_in_memory(mebibytes):
            env = VecMonitor(lidarium.sb3_vec_env(learner.episodes, learner.floors, **learner.world))
            inside = timed(env)
            model = MaskablePPO(
                learner.policy, env, n_steps=learner.rollout, batch_size=learner.batch, n_epochs=learner.epochs, seed=0
            )
            model.set_logger(Logger(None, []))  # its own makes a folder in the system's one for temporary files
            model.learn(WARM_DECISIONS)  # floors come into the store, and from it into memory
            count, found = TIMED_ROLLOUTS * learner.episodes * learner.rollout, []
            for _ in range(rounds):
                inside[0], began = 0.0, time.perf_counter()
                model.learn(count, reset_num_timesteps=False)
                seconds = time.perf_counter() - began
                found.append((count / seconds, inside[0] / seconds))
            env.close()
    finally:
        torch.set_num_threads(threads)
    return found


def timed(environments: Any) -> list[float]:  # noqa: ANN401
    """Add up the seconds of steps of environments; the sum is the list's only number."""
    seconds, step_wait = [0.0], environments.step_wait

    def step() -> Any:  # noqa: ANN401
        began = time.perf_counter()
        result = step_wait()
        seconds[0] += time.perf_counter() - began
        return result

    environments.step_wait = step
    return seconds


@contextmanager
def _floors_in_memory(mebibytes: int | None) -> Iterator[None]:
    """Let unused floors take that many MiB of memory; as many as usual if None."""
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


CORES = 2
TO_REACH = 4000.0
LEARNER = Learner("MultiInputPolicy", episodes=64, rollout=32, batch=512, epochs=4, floors=FLOORS)

NOTES = (
    f"*MaskablePPO*: of sb3-contrib, its `MultiInputPolicy`, {LEARNER.episodes} episodes of one robot on `{FLOORS}` "
    f"from the store of floors, {LEARNER.rollout} decisions of each between updates of {LEARNER.epochs} epochs. Steps "
    f"are decisions, by the clock. *All floors in memory*: `{SIZE_VARIABLE}={ALL_MIB}`; the default is {DEFAULT_MIB:g} "
    "MiB. *Prepared*: the same training again, whose floors come from the store. *Simulator's share*: of the time.",
)


def measure(effort: Effort) -> list[Line]:
    """Measure training with as many floors in memory as usual, with all of them, on many floors, and in `fast`."""
    name = f"MaskablePPO, {LEARNER.episodes} episodes, two cores"
    if not is_there():
        return [Line(name, "-", f"not measured: {install_command('rl')}", None, TO_REACH, unit="steps/s")]
    lines = []
    many = replace(LEARNER, floors=MANY_FLOORS)
    for title, learner, mebibytes in (
        (name, LEARNER, None),
        (f"{name}, all floors in memory", LEARNER, ALL_MIB),
        (f"{name}, floors drawn from 10,000", many, None),
        (f"{name}, floors drawn from 10,000, prepared", many, None),
        (f"{name}, all floors in memory, fast", replace(LEARNER, world={**ROBOT, "realism": "fast"}), ALL_MIB),
    ):
        found = timings(learner, effort.rounds, mebibytes)
        rate, share = (statistics.median(each) for each in zip(*found, strict=True))
        told = f"{shown(rate)} steps/s"
        lines += [
            Line(title, told, "-", None, TO_REACH, rate, unit="steps/s"),
            Line(f"{title}, the simulator's share", f"{share:.2f}", "-", None, None, share, unit="of the time"),
        ]
    return lines


if __name__ == "__main__":
    run_alone(measure, "Steps of MaskablePPO.", CORES)
