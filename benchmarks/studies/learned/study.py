"""Learned explorers beside classic ones, on floors that no training has seen.

The floors of the set ``test`` and real ones choose nothing: neither settings nor weights.
"""

import json
import platform
from collections.abc import Sequence
from datetime import date
from importlib import resources
from pathlib import Path
from typing import Any

import lidarium
from lidarium.agents.learned.weights import CARD
from lidarium.benchmarks.studies.learned.tables import (
    CLASSICS,
    HORIZON_S,
    KINDS,
    LEARNED,
    TEAMS,
    TOURS,
    Times,
    bounds_table,
    card_text,
    missing_text,
    senders_table,
    times_table,
)
from lidarium.benchmarks.studies.shared.bounded import Bounded, measure_bound
from lidarium.benchmarks.studies.shared.kept import Progress, do_missing, kept_lines
from lidarium.benchmarks.studies.shared.real_floors import real_floors
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.envs.floors.catalogue.names import set_floors
from lidarium.evaluation.suites.campaign import EPISODES_FILE
from lidarium.evaluation.suites.episodes_file import KEY, read_episodes
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

SETTINGS: dict[str, Any] = {"resolution": 0.05, "stop_coverage": 0.99, "horizon_s": HORIZON_S}
CLASSICS_EVERY, BOUNDS_EVERY = 4, 8
"""Classic explorers run on every so many-th floor of the set; every so many-th has a bound."""

REAL_FLOORS = {"kth": slice(0, None, 4), "lifull": slice(1, None, 2), "slam": slice(0, None, 6)}
"""Which real floors run; settings of tours were chosen on some of the others."""

BOUNDS_FILE = "bounds.jsonl"

PAGE = """# Learned explorers

`learned` beside `tour_frontier`, whose tours it corrects, and `tour_frontier` beside the other classic
explorers: simulated time to 99 % of `C_free`, pair by pair, from the same starts. Kobuki, URG-04LX, perfect
poses, no noise, maps of 5 cm, cut at {horizon:.0f} s; runs that did not get there count as that. Nothing was
chosen by these floors. Beside `srt`, with SLAM and with unknown starts it is on the
[leaderboard](leaderboard.md).

Made with `{command}` on {date}: lidarium {version}, Python {python}.

## The weights

{card}

## Times

A ratio below 1 is less time. *Mean* is the geometric mean with its 95 % interval; *path* is the ratio of the
longest path of a robot.

{times}
{missing}
## What sends the robots

How often robots of `learned` set out, a run, and by what: where tours begin; elsewhere, as the network has
it; or to the nearest frontier, when what is left is too little for a stop of a tour.

{senders}

## Beside bounds

What a team needs that [knows the floor](../reference/bounds.md), on {bounded} floors of the set `test` that
have a bound: medians of multiples of its time, and the share of the time between `tour_frontier` and the
bound that `learned` saves.

{bounds}

## What limits it

The teacher knows the floor, and is what the network learns from. As a policy it takes 0.77 of the time of
tours with one robot, 0.85 with two and 0.87 with three
([decision 22](../decisions/0022-learned-corrections.md)).
A training on 2,700 floors, all of them furnished, gave 0.878, 0.896 and 0.938 on the set `test`. On LIFULL
it gave 1.03, 0.99 and 0.98. So neither more floors nor bare ones are what is missing.
"""


def suites(data: Path | None, every: int = 1) -> dict[str, Suite]:
    """Return the suites: all floors for the two, a part of them for classic explorers.

    Parameters
    ----------
    data : Path or None
        Folder of real floors; generated floors alone where None.
    every : int
        Of each kind every so many-th floor is run.
    """
    floors = {"test": list(set_floors("test"))[::every]}
    if data is not None:
        real = {kind: paths for kind, paths in real_floors(data).items() if kind in KINDS}
        floors |= {
            kind: [str(path) for path in paths[REAL_FLOORS[kind]][::every]] for kind, paths in real.items()
        }
    found = {}
    for kind, names in floors.items():
        found[kind] = _suite((TOURS, LEARNED), names)
        part = names[::CLASSICS_EVERY] if kind == "test" else names
        found[f"{kind}_classic"] = _suite(CLASSICS, part)
    return {kind: suite for kind, suite in found.items() if suite.floors}


def _suite(policies: Sequence[str], floors: Sequence[str]) -> Suite:
    return Suite(
        policies=tuple(policies),
        floors=tuple(floors),
        robots=TEAMS,
        seeds=(0,),
        variants={DEFAULT_VARIANT: SETTINGS},
    )


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Bound a part of the floors."""
    floors = set_floors("test")[:: BOUNDS_EVERY * every]
    teams = [Bounded(floor, robots, SETTINGS) for floor in floors for robots in TEAMS]
    yield from do_missing(folder / BOUNDS_FILE, "bounds", teams, measure_bound, workers)


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    episodes = {kind: _times_in(folder, kind) for kind in KINDS}
    bounds = kept_lines(folder / BOUNDS_FILE) if (folder / BOUNDS_FILE).exists() else []
    return PAGE.format(
        command=command,
        date=date.today().isoformat(),
        version=lidarium.__version__,
        python=platform.python_version(),
        horizon=HORIZON_S,
        card=card_text(json.loads((resources.files("lidarium.agents.learned") / "data" / CARD).read_text())),
        times="\n\n".join(times_table(kind, found) for kind, found in episodes.items() if found),
        missing=missing_text([kind for kind, found in episodes.items() if not found]),
        senders=senders_table(episodes),
        bounded=len({line["floor"] for line in bounds if line["known_s"] is not None}),
        bounds=bounds_table(bounds, episodes["test"]),
    )


def _times_in(folder: Path, kind: str) -> Times:
    """Return the episodes of a kind of floor by policy, floor and size of team."""
    found: Times = {}
    for name in (kind, f"{kind}_classic"):
        path = folder / name / EPISODES_FILE
        for episode in read_episodes(path) if path.exists() else []:
            # Floors by the names that were asked for; `building:3000000` calls itself by its kind.
            floor = episode[KEY].split(" | ")[1]
            found.setdefault(episode["policy"], {})[floor, episode["robots"]] = episode
    return found


STUDY = Study(page, suites, work)
