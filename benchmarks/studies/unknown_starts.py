"""The study ``unknown_starts``: who explores under a supervisor, beside nearest frontiers, with SLAM."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from lidarium.benchmarks.studies.leaderboard.pairs import pairs_table
from lidarium.benchmarks.studies.leaderboard.worlds import WORLDS
from lidarium.benchmarks.studies.shared.study import HORIZON_S, SETTINGS, Study
from lidarium.envs.floors.catalogue.names import set_floors
from lidarium.evaluation.suites.campaign import EPISODES_FILE
from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

WORLD, BASELINE = "unknown", "supervised"
EXPLORERS = ("supervised_tours", "supervised_predicted")

PAGE = """# Unknown starts

How much time teams save that explore by [tours](../reference/supervisor.md), or by tours on
[predicted maps](../reference/prediction.md), over those that drive to the nearest frontier. All are led by a supervisor
and do not know how they stand to each other.

Floors of the set `test` and starts are those of the world *lab, unknown starts* of the [leaderboard](leaderboard.md):
SLAM on noisy scans and odometry, Kobuki, URG-04LX, maps of 5 cm, simulated time, cut at {horizon:.0f} s.

## Pairs

Geometric means of ratios of times to 99 %, pair by pair, with 95 % intervals; runs that did not get there count as the
whole time.

{pairs}

## Joins

| policy | runs | reached 99 % | joins | wrong | runs with a wrong one |
|---|---:|---:|---:|---:|---:|
{joins}
"""


def suites(_data: Path | None, every: int = 1) -> dict[str, Suite]:
    """Return the one suite."""
    world = WORLDS[WORLD]
    suite = Suite(
        policies=(BASELINE, *EXPLORERS),
        floors=tuple(set_floors("test")[::every]),
        robots=world.teams,
        seeds=(0,),
        variants={DEFAULT_VARIANT: {**SETTINGS, **world.settings}},
    )
    return {WORLD: suite}


def joins_rows(episodes: Iterable[Mapping[str, Any]]) -> str:
    """Return how often each policy got there and joined maps, and how often in a wrong place."""
    rows = []
    every = list(episodes)
    for policy in (BASELINE, *EXPLORERS):
        own = [episode for episode in every if episode["policy"] == policy]
        accepted, wrong = ([episode["merges"][name] for episode in own] for name in ("accepted", "wrong"))
        reached = sum(episode["t99_s"] is not None for episode in own)
        counts = (len(own), reached, sum(accepted), sum(wrong), sum(each > 0 for each in wrong))
        rows.append(f"| `{policy}` | " + " | ".join(map(str, counts)) + " |")
    return "\n".join(rows)


def page(folder: Path) -> str:
    """Return the results as markdown."""
    episodes = read_episodes(folder / WORLD / EPISODES_FILE)
    tours, predicted = EXPLORERS
    pairs = [*((WORLD, policy, BASELINE) for policy in EXPLORERS), (WORLD, predicted, tours)]
    return PAGE.format(
        horizon=HORIZON_S,
        pairs=pairs_table({WORLD: episodes}, {WORLD: WORLDS[WORLD].about}, pairs),
        joins=joins_rows(episodes),
    )


STUDY = Study(page, suites, quick=200)
