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

PAGE = """# Attention to frontiers

{conclusion}

{seeds} networks learn by MaskablePPO and `FrontierPolicy` to choose frontiers, each from a seed of its own:
{decisions:,} decisions on `{train_floors}`. They are compared on {floors} floors that none of them has seen,
by the share of the floor that one robot has seen after {horizon_s:.0f} s, all from the floor's own start.
Networks choose what they prefer; before the first update that is the frontier of least cost, as in explore_lite.

{table}

The coverage of networks on a floor is the mean over the seeds; intervals are over floors. By seed the trained
ones reach {by_seed}. A training took {minutes:.0f} minutes on one core.

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


def learn(plan: Attention, seed: int, episodes: int = EPISODES) -> dict[str, Any]:
    """Train a network; return what it reached on the unseen floors before and after, and how long it took."""
    torch.set_num_threads(1)
    env = VecMonitor(lidarium.sb3_vec_env(episodes, plan.train_floors, horizon_s=plan.horizon_s, **ROBOT))
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
    return {UNTRAINED: untrained.tolist(), LEARNED: learned.tolist(), "minutes": minutes}


def main(plan: Attention) -> None:
    """Run all seeds and policies; write the page and its numbers."""
    with ProcessPoolExecutor(plan.workers, get_context("spawn")) as pool:
        seeds = list(pool.map(partial(learn, plan), range(plan.seeds)))
        classic = dict(zip(CLASSIC, pool.map(partial(run_classic, plan), CLASSIC), strict=True))
    seeds = seeds or json.loads((plan.out / "attention.json").read_text())["seeds"]
    networks = {name: np.mean([each[name] for each in seeds], axis=0).tolist() for name in (UNTRAINED, LEARNED)}
    numbers = compared(networks, classic)
    page = PAGE.format(
        seeds=len(seeds),
        decisions=plan.updates * EPISODES * ROLLOUT,
        train_floors=plan.train_floors,
        floors=len(lidarium.floor_set(plan.floors)),
        horizon_s=plan.horizon_s,
        conclusion=conclusion(plan.horizon_s, numbers["coverage"]),
        table=table(plan.horizon_s, numbers["coverage"], numbers["drawn"]),
        by_seed=", ".join(f"{100 * np.mean(each[LEARNED]):.1f} %" for each in seeds),
        minutes=np.mean([each["minutes"] for each in seeds]),
        version=lidarium.__version__,
        torch=torch.__version__,
    )
    plan.out.mkdir(parents=True, exist_ok=True)
    (plan.out / "attention.json").write_text(json.dumps({**numbers, "seeds": seeds}, indent=2) + "\n")
    write_page(plan.out / "attention.md", page)
    print(page)


if __name__ == "__main__":
    main(tyro.cli(Attention, description=__doc__))
