"""Memory of a learner's batch at the level of frontiers, over many episodes on new floors."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

import lidarium
from lidarium.benchmarks.speed.harness.lines import Line
from lidarium.benchmarks.speed.harness.memory import resident
from lidarium.benchmarks.speed.harness.report import run_alone
from lidarium.benchmarks.speed.harness.timing import Effort

CORES = 2
ROWS, FLOORS, HORIZON_S = 256, "set:train", 20.0
EPISODES, FEW_EPISODES = 10_000, 1_000
ALLOWED = 1.05

NOTES = (
    f'*Memory of a batch*: a process with `vector_env({ROWS}, "{FLOORS}", level="frontier")`, one robot each, episodes '
    f"of {HORIZON_S:.0f} s and choices drawn with equal probability, after each {ROWS} episodes. *Growth*: the maximum "
    f"of the last tenth over that of the second one; {EPISODES:,} episodes with full effort.",
)


def memory_over_episodes(rows: int, episodes: int) -> list[int]:
    """Return the memory of this process [bytes] after each ``rows`` of a number of episodes."""
    env = lidarium.vector_env(rows, FLOORS, level="frontier", robots=1, horizon_s=HORIZON_S, threads=CORES, copy=False)
    generator, taken, ended = np.random.default_rng(0), list[int](), 0
    mask = env.reset(seed=0)[0]["action_mask"]
    while ended < episodes:
        chances = generator.random(mask.shape) * mask
        chances[:, -1] *= 1e-6  # to stay only where nothing is offered
        observations, _, terminated, truncated, _ = env.step(chances.argmax(axis=1))
        mask, before = observations["action_mask"], ended
        ended += int((terminated | truncated).sum())
        if ended // rows > before // rows:
            taken.append(resident() or 0)
    return taken


def measure(effort: Effort) -> list[Line]:
    """Measure a batch in a separate process."""
    episodes = EPISODES if effort.is_full else FEW_EPISODES
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        taken = pool.submit(memory_over_episodes, ROWS, episodes).result()
    tenth = max(len(taken) // 10, 1)
    peak, growth = max(taken) / 2**20, max(taken[-tenth:]) / max(max(taken[tenth : 2 * tenth]), 1)
    told = f"after {episodes:,} episodes"
    if peak == 0.0:
        return [Line("memory of a batch of learners", "not told by this system", "-", None, None)]
    return [
        Line("memory of a batch of learners, peak", f"{peak:,.0f} MiB", told, None, None, peak, unit="MiB"),
        Line("its growth", f"{growth:.3f} x", told, None, ALLOWED, growth, is_upper_bound=True),
    ]


if __name__ == "__main__":
    run_alone(measure, "Memory of a batch of learners.", CORES)
