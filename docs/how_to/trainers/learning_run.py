"""Train explorers from several seeds, and compare them on floors that they have not seen.

Usage: python docs/how_to/trainers/learning_run.py --out docs/results
"""

import json
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from numpy.typing import NDArray
from ppo import ROBOT, Report, Scorer, Settings, as_tensors, train
from scipy import stats

import lidarium

LEARNED, UNTRAINED = "trained networks", "untrained networks"
CLASSIC = ("random_walk", "nearest_frontier", "utility_frontier", "explore_lite", "tour_frontier", "learned")
STARTS = {"starts": "fixed"}
"""Starts of all that are compared; without it a batch draws them, and a policy's run takes those of the floor."""

SEEDS_APART = 1000
"""Episodes of a batch have seeds that follow each other; those of networks share none."""

SMOOTHED = 4
"""Updates over which curves are averaged: each has few episodes, and floors differ."""

PAGE = """# A run that learns

{conclusion}

{seeds} networks learn to choose frontiers, each from a seed of its own: {decisions:,} decisions on
{train_floors:,} generated floors. They are compared on {floors} floors that none of them has seen, by the
share of the floor that one robot has seen after {horizon_s:.0f} s, all from the floor's own start. Networks
draw their choices as they do in training; before the first update they draw almost evenly.

![Coverage at the end of training episodes]({name}.png)

{table}

The coverage of networks on a floor is the mean over the seeds; intervals are over floors. By seed the trained
ones reach {by_seed}. Training took {minutes:.0f} minutes.

Made with `python docs/how_to/trainers/learning_run.py`, lidarium {version}.
"""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Train explorers and compare them on unseen floors."""

    seeds: int = 5
    """how many networks; 0 compares the figures of those that are in --out with classic policies of today"""
    updates: int = 200
    """updates of each, of 1,024 decisions"""
    train_floors: str = "set:train:1000"
    """what they learn on"""
    floors: str = "set:validation:50"
    """what they are compared on"""
    horizon_s: float = 60.0
    """simulated time of an episode [s]"""
    workers: int = 2
    """processes"""
    out: Path = Path("docs/results")
    """folder for the page, its picture and its numbers"""


def final_coverage(
    choose: Callable[[dict[str, NDArray[Any]]], NDArray[Any]],
    floors: tuple[str, ...],
    options: dict[str, Any],
) -> NDArray[np.float64]:
    """Return the coverage that is reached on each floor, where a callable chooses for all rows at once."""
    env = lidarium.vector_env(len(floors), **{**STARTS, **options, "floor": floors[0]}, copy=False)
    observations, infos = env.reset(seed=[0] * len(floors), options={"floor": list(floors)})
    reached, is_over = infos["truth"]["coverage"].copy(), np.zeros(len(floors), np.bool_)
    while not is_over.all():
        observations, _, terminated, truncated, infos = env.step(choose(observations))
        reached[~is_over] = infos["truth"]["coverage"][~is_over]
        is_over |= terminated | truncated
    return np.asarray(reached, np.float64)


def drawn_by(network: Scorer) -> Callable[[dict[str, NDArray[Any]]], NDArray[Any]]:
    """Return what draws choices by a network's preferences."""
    torch.manual_seed(0)

    def draw(observations: dict[str, NDArray[Any]]) -> NDArray[Any]:
        with torch.no_grad():
            choices, _ = network(*as_tensors(observations))
        return np.asarray(choices.sample().numpy())

    return draw


def run_seed(plan: Plan, seed: int) -> dict[str, Any]:
    """Train a network; return its curve, and what it reached on the unseen floors before and after."""
    torch.set_num_threads(1)
    options = {"robots": 1, "horizon_s": plan.horizon_s, "threads": 1}
    floors = lidarium.floor_set(plan.floors)
    torch.manual_seed(seed)
    untrained = final_coverage(drawn_by(Scorer()), floors, {**ROBOT, **options})
    curve: list[Report] = []
    network = Scorer()
    for report, trained in train(
        {"floor": plan.train_floors, **options}, Settings(updates=plan.updates, seed=SEEDS_APART * seed)
    ):
        curve.append(report)
        network = trained
    return {
        "curve": [report.coverage for report in curve],
        UNTRAINED: untrained.tolist(),
        LEARNED: final_coverage(drawn_by(network), floors, {**ROBOT, **options}).tolist(),
    }


def classic_coverage(name: str, floors: tuple[str, ...], options: dict[str, Any]) -> list[float]:
    """Return what a policy of the package reaches on each floor."""
    reached = []
    for floor in floors:
        env = lidarium.ExplorationEnv(floor, lidarium.make_settings(**{**STARTS, **options}))
        lidarium.run_episode(lidarium.policy(name), env, seed=0)
        reached.append(env.scorer.coverage)
    return reached


def run_classic(plan: Plan, name: str) -> tuple[list[float], list[float]]:
    """Return what a policy of the package reaches on each of the unseen floors, and what from drawn starts."""
    floors, options = lidarium.floor_set(plan.floors), {"robots": 1, "horizon_s": plan.horizon_s}
    return classic_coverage(name, floors, options), classic_coverage(name, floors, {**options, "starts": "drawn"})


def run(plan: Plan) -> dict[str, Any]:
    """Run all seeds and policies, side by side; return the numbers of the page."""
    began = time.monotonic()
    with ProcessPoolExecutor(plan.workers, get_context("spawn")) as pool:
        seeds = list(pool.map(partial(run_seed, plan), range(plan.seeds)))
        minutes = (time.monotonic() - began) / 60.0
        classic = dict(zip(CLASSIC, pool.map(partial(run_classic, plan), CLASSIC), strict=True))
    if seeds:
        found: dict[str, Any] = {
            "curves": [seed["curve"] for seed in seeds],
            "by_seed": [float(np.mean(seed[LEARNED])) for seed in seeds],
            "minutes": minutes,
        }
        networks = {name: np.mean([seed[name] for seed in seeds], axis=0).tolist() for name in (UNTRAINED, LEARNED)}
    else:
        found = json.loads((plan.out / "training.json").read_text())
        networks = {name: found["coverage"][name] for name in (UNTRAINED, LEARNED)}
    return {**found, **compared(networks, classic)}


def compared(
    networks: dict[str, list[float]], classic: dict[str, tuple[list[float], list[float]]]
) -> dict[str, dict[str, list[float]]]:
    """Return the coverages of all from the floors' own starts, and those of the classic policies from drawn ones."""
    coverage = {**{name: fixed for name, (fixed, _) in classic.items()}, **networks}
    return {"coverage": coverage, "drawn": {name: drawn for name, (_, drawn) in classic.items()}}


def interval(sample: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return the mean and its 95 % interval by Student's t."""
    mean = float(sample.mean())
    half = float(stats.t.ppf(0.975, len(sample) - 1) * stats.sem(sample)) if len(sample) > 1 else np.nan
    return mean, mean - half, mean + half


def table(horizon_s: float, coverage: dict[str, list[float]], drawn: dict[str, list[float]]) -> str:
    """Return the table of coverages, the least first."""
    lines = [
        f"| | seen after {horizon_s:.0f} s, mean and 95 % interval | trained networks less this, floor by floor | "
        "seen from drawn starts |",
        "|---|---:|---:|---:|",
    ]
    for name, reached in sorted(coverage.items(), key=lambda each: float(np.mean(each[1]))):
        mean, low, high = 100.0 * np.array(interval(np.array(reached)))
        less = "-" if name == LEARNED else more_than(coverage, name)
        other = f"{100.0 * np.mean(drawn[name]):.1f} %" if name in drawn else "-"
        shown = f"`{name}`" if name in drawn else name
        lines.append(f"| {shown} | {mean:.1f} ({low:.1f} to {high:.1f}) % | {less} | {other} |")
    return "\n".join(lines)


def more_than(coverage: dict[str, list[float]], name: str) -> str:
    """Return how much more of a floor trained networks see, in points of per cent."""
    gap, lowest, highest = 100.0 * np.array(interval(np.subtract(coverage[LEARNED], coverage[name])))
    return f"{gap:+.1f} ({lowest:+.1f} to {highest:+.1f}) %"


def conclusion(horizon_s: float, coverage: dict[str, list[float]]) -> str:
    """Say how much trained networks see, and what the nearest frontier and the best classic policy do."""
    shares = {name: 100.0 * float(np.mean(reached)) for name, reached in coverage.items()}
    best = max(CLASSIC, key=lambda name: shares[name])
    return (
        f"Trained networks see {shares[LEARNED]:.1f} % of an unseen floor in {horizon_s:.0f} s with one robot, "
        f"untrained ones {shares[UNTRAINED]:.1f} %.\nThe nearest frontier sees {shares['nearest_frontier']:.1f} % "
        f"from the same starts, `{best}`, the best classic policy, {shares[best]:.1f} %:\n"
        f"floor by floor the networks differ from `tour_frontier` by {more_than(coverage, best)} (mean, 95 % interval)."
    )


def smoothed(curve: list[float]) -> NDArray[np.float64]:
    """Return means over the last `SMOOTHED` updates, of those in which episodes ended."""
    windows = [curve[max(k - SMOOTHED + 1, 0) : k + 1] for k in range(len(curve))]
    return np.array([np.nanmean(each) if np.isfinite(each).any() else np.nan for each in windows])


def draw(curves: dict[str, list[list[float]]], decisions: int, path: Path) -> None:
    """Draw coverage over decisions, so many an update: the mean of the seeds, and each seed."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6.4, 3.6), layout="constrained")
    for name, seeds in curves.items():
        values = 100.0 * np.array([smoothed(curve) for curve in seeds])
        over = decisions * np.arange(1, values.shape[1] + 1)
        (line,) = axes.plot(over, np.nanmean(values, axis=0), label=name)
        axes.plot(over, values.T, color=line.get_color(), alpha=0.25, linewidth=0.8)
    axes.set(xlabel="decisions", ylabel="coverage at the end [%]")
    axes.legend()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def main(plan: Plan, name: str = "training") -> None:
    """Run the plan, and write the page."""
    numbers = run(plan)
    draw({LEARNED: numbers["curves"]}, Settings().decisions, plan.out / f"{name}.png")
    (plan.out / f"{name}.json").write_text(json.dumps(numbers, indent=2) + "\n")
    page = PAGE.format(
        seeds=len(numbers["by_seed"]),
        decisions=plan.updates * Settings().decisions,
        train_floors=len(lidarium.floor_set(plan.train_floors)),
        floors=len(lidarium.floor_set(plan.floors)),
        horizon_s=plan.horizon_s,
        name=name,
        conclusion=conclusion(plan.horizon_s, numbers["coverage"]),
        table=table(plan.horizon_s, numbers["coverage"], numbers["drawn"]),
        by_seed=", ".join(f"{100 * each:.1f} %" for each in numbers["by_seed"]),
        minutes=numbers["minutes"],
        version=lidarium.__version__,
    )
    write_page(plan.out / f"{name}.md", page)
    print(f"{plan.out / name}.md is written")


def write_page(path: Path, page: str) -> None:
    """Write a page; its section of notes, if it has one, stays."""
    _, heading, notes = (path.read_text() if path.exists() else "").partition("\n## Notes\n")
    path.write_text(page + heading + notes)


if __name__ == "__main__":
    main(tyro.cli(Plan))
