"""Train networks that attend to frontiers, and compare them on floors that they have not seen.

Usage: python docs/how_to/trainers/attention.py --out docs/results
"""

import json
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from typing import Any

import numpy as np
import torch
import tyro
from learning_run import (
    CLASSIC,
    LEARNED,
    SEEDS_APART,
    UNTRAINED,
    Plan,
    compared,
    conclusion,
    final_coverage,
    more_than,
    run_classic,
    table,
    write_page,
)
from numpy.typing import NDArray
from sb3_contrib import MaskablePPO
from stable_baselines3.common.vec_env import VecMonitor

import lidarium

ROBOT = {
    "level": "frontier",
    "observe": ["frontiers", "frontier_gains", "time_left"],
    "robots": 1,
    "threads": 1,
}
EPISODES, ROLLOUT = 32, 64
FAST = "networks trained in the fast world"
WORLDS = {LEARNED: "ideal", FAST: "fast"}
"""Realism of the world in which networks learn; all are compared in the full one."""

PAGE = """# Attention to frontiers

{conclusion}

{seeds} networks learn by MaskablePPO and `FrontierPolicy` to choose frontiers, each from a seed of its own:
{decisions:,} decisions on `{train_floors}`. They are compared on {floors} floors that none of them has seen,
by the share of the floor that one robot has seen after {horizon_s:.0f} s, all from the floor's own start.
Networks choose what they prefer; before the first update that is the frontier of least cost, as in explore_lite.

{table}

The coverage of networks on a floor is the mean over the seeds; intervals are over floors. By seed the trained
ones reach {by_seed}. A training took {minutes:.1f} minutes on one core.

From the same seeds, a training in [the fast world](../reference/realism.md#fast) took {fast_minutes:.1f} minutes. In
the full world these networks see {gap} less of a floor than those trained there; by seed they reach
{fast_by_seed}.

Networks of [a run that learns](training.md) score each frontier by itself, and draw their choices.

Made with `python docs/how_to/trainers/attention.py`, lidarium {version}, PyTorch {torch}.
"""


@dataclass(frozen=True, kw_only=True)
class Attention(Plan):
    """Train networks that attend to frontiers and compare them on unseen floors."""

    seeds: int = 4
    """how many networks"""
    updates: int = 100
    """updates of each, of 2,048 decisions"""


def preferred_by(model: MaskablePPO) -> Callable[[dict[str, NDArray[Any]]], NDArray[Any]]:
    """Return what chooses as a model prefers."""
    return lambda seen: np.asarray(model.predict(seen, action_masks=seen["action_mask"], deterministic=True)[0])


def learn(plan: Attention, name: str, seed: int, episodes: int = EPISODES) -> dict[str, Any]:
    """Train a network; return what it reached on the unseen floors before and after, and how long it took."""
    torch.set_num_threads(1)
    world = {"realism": WORLDS[name], "horizon_s": plan.horizon_s}
    env = VecMonitor(lidarium.sb3_vec_env(episodes, plan.train_floors, **world, **ROBOT))
    model = MaskablePPO(
        lidarium.FrontierPolicy,
        env,
        n_steps=ROLLOUT,
        batch_size=min(512, episodes * ROLLOUT),
        n_epochs=3,
        learning_rate=5e-4,
        gamma=0.98,
        ent_coef=0.005,
        seed=SEEDS_APART * seed,
    )
    floors, options = lidarium.floor_set(plan.floors), {**ROBOT, "horizon_s": plan.horizon_s}
    untrained, began = final_coverage(preferred_by(model), floors, options), time.perf_counter()
    model.learn(plan.updates * episodes * ROLLOUT)
    minutes = (time.perf_counter() - began) / 60.0
    learned = final_coverage(preferred_by(model), floors, options)
    return {UNTRAINED: untrained.tolist(), name: learned.tolist(), f"minutes of {name}": minutes}


def by_seed(seeds: list[dict[str, Any]], name: str) -> str:
    """Return the mean coverage that each network reached."""
    return ", ".join(f"{100 * np.mean(each[name]):.1f} %" for each in seeds)


def minutes(seeds: list[dict[str, Any]], name: str) -> float:
    """Return how long a training took, the median."""
    return float(np.median([each[f"minutes of {name}"] for each in seeds]))


def main(plan: Attention) -> None:
    """Run all seeds and policies; write the page and its numbers."""
    with ProcessPoolExecutor(plan.workers, get_context("spawn")) as pool:
        trained = {name: pool.map(partial(learn, plan, name), range(plan.seeds)) for name in WORLDS}
        seeds = [full | fast for full, fast in zip(*trained.values(), strict=True)]
        classic = dict(zip(CLASSIC, pool.map(partial(run_classic, plan), CLASSIC), strict=True))
    seeds = seeds or json.loads((plan.out / "attention.json").read_text())["seeds"]
    networks = {name: np.mean([each[name] for each in seeds], axis=0).tolist() for name in (UNTRAINED, *WORLDS)}
    numbers = compared(networks, classic)
    page = PAGE.format(
        seeds=len(seeds),
        decisions=plan.updates * EPISODES * ROLLOUT,
        train_floors=plan.train_floors,
        floors=len(lidarium.floor_set(plan.floors)),
        horizon_s=plan.horizon_s,
        conclusion=conclusion(plan.horizon_s, numbers["coverage"]),
        table=table(plan.horizon_s, numbers["coverage"], numbers["drawn"]),
        by_seed=by_seed(seeds, LEARNED),
        minutes=minutes(seeds, LEARNED),
        fast_by_seed=by_seed(seeds, FAST),
        fast_minutes=minutes(seeds, FAST),
        gap=more_than(numbers["coverage"], FAST),
        version=lidarium.__version__,
        torch=torch.__version__,
    )
    plan.out.mkdir(parents=True, exist_ok=True)
    (plan.out / "attention.json").write_text(json.dumps({**numbers, "seeds": seeds}, indent=2) + "\n")
    write_page(plan.out / "attention.md", page)
    print(page)


if __name__ == "__main__":
    main(tyro.cli(Attention, description=__doc__))
