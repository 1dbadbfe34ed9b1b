"""Train explorers by several rewards, and draw how each learns.

Usage: python docs/how_to/trainers/shaping.py --out docs/results
"""

import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from learning_run import SEEDS_APART, draw
from ppo import Settings, train

import lidarium

REWARDS: dict[str, dict[str, Any]] = {
    "area": {},
    "share of the floor": {"area": 0.0, "more": {"floor_share": 10.0}},
    "area, dear metres": {"energy": 3.0},
    "completion alone": {"area": 0.0, "more": {"completion": 10.0}},
}
"""What is paid, by name; the first is the default of the package."""

FAST = Settings(episodes=16, minibatch=64)
"""Learns much from few decisions."""

PAGE = """# Rewards and what is learned

One robot learns to choose frontiers by each of {rewards} rewards, from {seeds} seeds: {decisions:,}
decisions, episodes of {horizon_s:.0f} s on generated floors. Rewards cannot be compared; coverage can.

![Coverage at the end of training episodes, by reward](shaping.png)

| reward | setting | coverage, first fifth | last fifth | gained |
|---|---|---:|---:|---:|
{table}

Coverage is that at the end of training episodes, by choices that the network draws; ± is the spread of seeds.
[Shape a reward](../tutorials/shape_a_reward.md) says how to read this.

Made with `python docs/how_to/trainers/shaping.py`, lidarium {version}.
"""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Train by each reward from several seeds."""

    seeds: int = 2
    """how many networks for each reward"""
    updates: int = 36
    """updates of each, of 512 decisions"""
    train_floors: str = "set:train:64"
    """what they learn on"""
    horizon_s: float = 40.0
    """simulated time of an episode [s]"""
    workers: int = 2
    """processes"""
    out: Path = Path("docs/results")
    """folder for the page, its picture and its numbers"""


def learn(plan: Plan, task: tuple[str, int]) -> list[float]:
    """Return the coverage of episodes that ended in each update."""
    torch.set_num_threads(1)
    reward, seed = task
    options = {
        "floor": plan.train_floors,
        "robots": 1,
        "horizon_s": plan.horizon_s,
        "threads": 1,
        "reward": REWARDS[reward],
    }
    return [
        report.coverage for report, _ in train(options, replace(FAST, updates=plan.updates, seed=SEEDS_APART * seed))
    ]


def table(curves: dict[str, list[list[float]]]) -> str:
    """Return the lines of the table: coverage early and late, and what was gained, by reward."""
    lines = []
    for name, seeds in curves.items():
        values = 100.0 * np.array(seeds)
        fifth = max(values.shape[1] // 5, 1)
        early, late = np.nanmean(values[:, :fifth], axis=1), np.nanmean(values[:, -fifth:], axis=1)
        cells = (f"{each.mean():.1f} ± {each.std():.1f} %" for each in (early, late, late - early))
        lines.append(f"| {name} | `{REWARDS[name] or 'default'}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def main(plan: Plan) -> None:
    """Train by all rewards, and write the page."""
    tasks = list(product(REWARDS, range(plan.seeds)))
    with ProcessPoolExecutor(plan.workers, get_context("spawn")) as pool:
        learned = list(pool.map(partial(learn, plan), tasks))
    curves: dict[str, list[list[float]]] = {name: [] for name in REWARDS}
    for (name, _), curve in zip(tasks, learned, strict=True):
        curves[name].append(curve)
    draw(curves, FAST.decisions, plan.out / "shaping.png")
    (plan.out / "shaping.json").write_text(json.dumps(curves, indent=2) + "\n")
    page = PAGE.format(
        rewards=len(REWARDS),
        seeds=plan.seeds,
        decisions=plan.updates * FAST.decisions,
        horizon_s=plan.horizon_s,
        table=table(curves),
        version=lidarium.__version__,
    )
    (plan.out / "shaping.md").write_text(page)
    print(f"{plan.out / 'shaping'}.md is written")


if __name__ == "__main__":
    main(tyro.cli(Plan))
