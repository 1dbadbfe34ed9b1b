"""The study ``fast``: explorers in the world of ``realism="fast"`` beside the full world, on the same floors."""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.benchmarks.studies.shared.study import Study
from lidarium.envs.floors.catalogue.names import set_floors
from lidarium.evaluation.statistics.estimates import paired_ratio
from lidarium.evaluation.suites.campaign import EPISODES_FILE
from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.evaluation.suites.suite import Suite

POLICIES = ("nearest_frontier", "utility_frontier", "tour_frontier", "learned")
FLOORS, TEAMS = 60, (1, 2)
HORIZON_S = 1800.0
FULL, FAST = "full", "fast"
_WORLD: dict[str, Any] = {"stop_coverage": 0.99, "horizon_s": HORIZON_S, "resolution": 0.05}
WORLDS: dict[str, dict[str, Any]] = {
    FULL: {**_WORLD, "realism": "ideal"},
    FAST: {name: value for name, value in _WORLD.items() if name != "resolution"} | {"realism": "fast"},
}

Episodes = dict[tuple[str, str], dict[tuple[str, int], Mapping[str, Any]]]
"""Episodes by world and policy, and by floor and size of team."""

PAGE = """# The fast world for learners

`realism="fast"` has fewer scans, fewer beams and coarser maps ([realism](../reference/realism.md#fast)). Policies that
were made in the full world (maps of 0.05 m) explore {floors} floors of the set `validation` in both worlds, with the
same starts, to 99 % of the floor or {horizon:.0f} s.

## Times

Time to 99 % in the fast world over that in the full one, floor by floor; a miss of 99 % counts with
{horizon:.0f} s. 95 % intervals are over floors.

| robots | policy | floors | full, mean [s] | fast, mean [s] | fast over full | reached 99 %: full, fast |
|---:|---|---:|---:|---:|---:|---:|
{times}

## Choice of a policy

A policy that is chosen in the fast world should be the better one in the full world. Times over those of another
policy, in either world:

| robots | policy | over | in the full world | in the fast world |
|---:|---|---|---:|---:|
{choices}

The policy with the lowest mean time in the fast world takes {lost} of the time of the best one in the full world, over
both sizes of teams.
"""


def suites(_data: Path | None, every: int = 1) -> dict[str, Suite]:
    """Return the suite of all policies in both worlds."""
    return {
        "validation": Suite(
            policies=POLICIES, floors=set_floors("validation")[:FLOORS:every], robots=TEAMS, seeds=(0,), variants=WORLDS
        )
    }


def page(folder: Path) -> str:
    """Return the results as markdown."""
    episodes: Episodes = {}
    for line in read_episodes(folder / "validation" / EPISODES_FILE):
        episodes.setdefault((line["variant"], line["policy"]), {})[line["floor"], line["robots"]] = line
    common = sorted(set.intersection(*(set(each) for each in episodes.values())))
    return PAGE.format(
        floors=len({floor for floor, _ in common}),
        horizon=HORIZON_S,
        times="\n".join(_times(episodes, common, policy, robots) for robots in TEAMS for policy in POLICIES),
        choices="\n".join(
            _choice(episodes, common, better, other, robots) for robots in TEAMS for other, better in pairwise(POLICIES)
        ),
        lost=_lost(episodes, common),
    )


def _seconds(episodes: Episodes, common: list[tuple[str, int]], world: str, policy: str, robots: int) -> list[float]:
    found = episodes[world, policy]
    times = [found[key]["t99_s"] for key in common if key[1] == robots]
    return [HORIZON_S if time is None else float(time) for time in times]


def _times(episodes: Episodes, common: list[tuple[str, int]], policy: str, robots: int) -> str:
    full, fast = (_seconds(episodes, common, world, policy, robots) for world in (FULL, FAST))
    reached = ", ".join(f"{sum(time < HORIZON_S for time in times)}" for times in (full, fast))
    means = f"{np.mean(full):.1f} | {np.mean(fast):.1f}"
    return f"| {robots} | `{policy}` | {len(full)} | {means} | {paired_ratio(fast, full):.3f} | {reached} |"


def _choice(episodes: Episodes, common: list[tuple[str, int]], better: str, other: str, robots: int) -> str:
    ratios = []
    for world in (FULL, FAST):
        ours, theirs = (_seconds(episodes, common, world, policy, robots) for policy in (better, other))
        ratios.append(paired_ratio(ours, theirs))
    return f"| {robots} | `{better}` | `{other}` | {ratios[0]:.3f} | {ratios[1]:.3f} |"


def _lost(episodes: Episodes, common: list[tuple[str, int]]) -> str:
    def mean(world: str, policy: str) -> float:
        return float(np.mean([_seconds(episodes, common, world, policy, robots) for robots in TEAMS]))

    chosen = min(POLICIES, key=lambda policy: mean(FAST, policy))
    return f"{mean(FULL, chosen) / min(mean(FULL, policy) for policy in POLICIES):.3f}"


STUDY = Study(page, suites, quick=30)
