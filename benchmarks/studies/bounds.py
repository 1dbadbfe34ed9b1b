"""Bounds: what a team that knows the floor needs, how tight that is, and what explorers need besides it."""

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarium.agents import make_policy
from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.catalogue.names import load_floor, set_floors
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.bounds.bound import graph_of, known_floor_bound
from lidarium.evaluation.bounds.relaxation import relax
from lidarium.evaluation.bounds.tours import plan_tours
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.suites.starts import starts_in

SMALL_FLOORS = tuple(f"apartment:{number}" for number in range(20))
"""Floors on which the plan is compared with what no walk can beat."""

SPACING = (0.9, 0.4)
"""Side of the squares of places, and distance of points to see, on small floors [m]."""

POLICIES = ("nearest_frontier", "utility_frontier", "explore_lite", "tour_frontier", "srt")
TEAMS = (1, 2, 3)
GOAL, HORIZON_S = 0.99, 1800.0
ROUNDS = 300
PLAN_ROUNDS = 2000
EXACT_S, RELAX_S = 60.0, 240.0
"""Time for the optimum of a small floor, and before that for the cuts of its lower bound [s]."""

FLOORS_EVERY = 20
"""Of the set ``validation`` every so many-th floor is bounded."""

TIGHT_FILE, FLOORS_FILE = "tight.jsonl", "floors.jsonl"

TIGHT_TABLE = """| floor | places | plan [m] | lower bound [m] | ratio | optimum [m] |
|---|---:|---:|---:|---:|---:|"""

PAGE = """# Bounds

How soon a team that has the floor plan can see 99 % of the floor. Views that see all are chosen from a lattice of
places, ordered by OR-Tools and improved; the tours are driven with the robots' limits. The plan is feasible, so its
time is an upper bound on the optimum.

## How tight

One robot on {tight_count} generated apartments, on a graph of places {side:g} m apart: the plan's length over
the lower bound of a linear program, to which cuts are added for at most {relax:.0f} s (less in a part of the study).

| | mean | worst |
|---|---:|---:|
| plan over lower bound | {mean:.3f} | {worst:.3f} |

{exact}

{tight}

## Explorers

Kobuki, URG-04LX, perfect poses, maps of 5 cm, {floor_count} floors of the set `validation`, drawn starts. Medians
over floors: the time of the plan, then each policy's time to 99 % as a multiple of it; runs that miss 99 % count
with {horizon:.0f} s.

| robots | known floor [s] | {titles} |
|---:|---:|{rule}
{table}
"""


@dataclass(frozen=True, slots=True)
class Small(Task):
    """A small floor; its bound may take the whole time divided by ``part``."""

    floor: str
    part: int


@dataclass(frozen=True, slots=True)
class Team(Task):
    """A floor and a number of robots."""

    floor: str
    robots: int


def settings_of(robots: int) -> ExplorationSettings:
    """Return the settings of all teams."""
    return make_settings(robots=robots, starts="drawn", resolution=0.05, stop_coverage=GOAL, horizon_s=HORIZON_S)


def measure_small(small: Small) -> dict[str, Any]:
    """Plan on a small floor, and bound the plan's length, in a part of the time."""
    settings = settings_of(1)
    graph = graph_of(load_floor(small.floor), settings, starts_in(small.floor, settings, 0), SPACING)
    plan = min(float(plan_tours(graph, GOAL, PLAN_ROUNDS, seed).lengths[0]) for seed in range(4))
    found = relax(graph, GOAL, exact_s=EXACT_S / small.part, limit_s=RELAX_S / small.part)
    optimum = found.optimum_m if math.isfinite(found.optimum_m) else None
    return {
        "floor": small.floor,
        "places": len(graph.places),
        "plan_m": plan,
        "lower_m": found.lower_m,
        "optimum_m": optimum,
    }


def measure_team(team: Team) -> dict[str, Any]:
    """Let a team that knows the floor and all explorers see it."""
    settings = settings_of(team.robots)
    starts = starts_in(team.floor, settings, 0)
    bound = known_floor_bound(team.floor, settings, starts, ROUNDS)
    times = {}
    for name in POLICIES:
        env = ExplorationEnv(team.floor, settings)
        run_episode(make_policy(name), env, 0, {"starts": starts})
        times[name] = env.scorer.times.get(GOAL)
    known = bound.time_s if math.isfinite(bound.time_s) else None
    return {"floor": team.floor, "robots": team.robots, "known_s": known, "seen": bound.share, "times_s": times}


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Do the small floors, then the set `validation`."""
    small = [Small(floor, every) for floor in SMALL_FLOORS[::every]]
    yield from do_missing(folder / TIGHT_FILE, "small floors", small, measure_small, workers)
    floors = set_floors("validation")[:: FLOORS_EVERY * every]
    teams = [Team(floor, robots) for floor in floors for robots in TEAMS]
    yield from do_missing(folder / FLOORS_FILE, "teams", teams, measure_team, workers)


def table(lines: Sequence[Mapping[str, Any]]) -> str:
    """Return a row for each size of team: the bound's time, and multiples of it."""
    rows = []
    for robots in TEAMS:
        members = [line for line in lines if line["robots"] == robots and line["known_s"] is not None]
        if members:
            known = f"{statistics.median(line['known_s'] for line in members):.0f}"
            cells = [f"{statistics.median(_multiples(members, name)):.2f}" for name in POLICIES]
        else:
            known, cells = "-", ["-"] * len(POLICIES)
        rows.append(f"| {robots} | {known} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def _multiples(lines: Sequence[Mapping[str, Any]], policy: str) -> list[float]:
    return [(line["times_s"][policy] or HORIZON_S) / line["known_s"] for line in lines]


def _tight_row(line: Mapping[str, Any]) -> str:
    optimum = "-" if line["optimum_m"] is None else f"{line['optimum_m']:.2f}"
    plan, lower = line["plan_m"], line["lower_m"]
    ratio = f"{plan / lower:.3f}" if lower > 0.0 else "-"
    cells = (line["floor"], line["places"], f"{plan:.2f}", f"{lower:.2f}", ratio, optimum)
    return "| " + " | ".join(str(each) for each in cells) + " |"


def page(folder: Path) -> str:
    """Return the results as markdown."""
    tight, teams = kept_lines(folder / TIGHT_FILE), kept_lines(folder / FLOORS_FILE)
    ratios = [line["plan_m"] / line["lower_m"] for line in tight if line["lower_m"] > 0.0]
    solved = [line for line in tight if line["optimum_m"] is not None]
    exact = f"Solved to the optimum within {EXACT_S:.0f} s: {len(solved)} of {len(tight)}."
    if any(line["lower_m"] > 0.0 for line in solved):
        gaps = [line["optimum_m"] / line["lower_m"] for line in solved if line["lower_m"] > 0.0]
        plans = [line["plan_m"] / line["optimum_m"] for line in solved if line["lower_m"] > 0.0]
        exact += (
            f" There the optimum is {statistics.mean(gaps):.3f} times the lower bound, and the plan "
            f"{statistics.mean(plans):.3f} times the optimum, in the mean."
        )
    missed = sum(line["known_s"] is None for line in teams)
    rows = "\n".join(_tight_row(line) for line in tight)
    text = PAGE.format(
        tight_count=len(tight),
        side=SPACING[0],
        mean=statistics.mean(ratios),
        worst=max(ratios),
        relax=RELAX_S,
        exact=exact,
        tight=in_file(f"{TIGHT_TABLE}\n{rows}"),
        floor_count=len({line["floor"] for line in teams}),
        horizon=HORIZON_S,
        titles=" | ".join(f"`{name}`" for name in POLICIES),
        rule="---:|" * len(POLICIES),
        table=table(teams),
    )
    return text + (f"\nPlans whose drive did not see 99 %: {missed}, left out.\n" if missed else "")


STUDY = Study(page, work=work, quick=10, needs={"bounds": ("ortools",)})
