"""How long the policies take on drawn floors, with 1, 2 and 3 robots.

Perfect poses, no noise, maps of 2.5 cm as in ``lidarium run``; starts are drawn by the seed, the same for all
policies. Each entry is the median over the seeds of the simulated time until 99 % of C_free were sensed;
where a run ended short of that, the least coverage at the end stands instead.
"""

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lidarium
from lidarium.agents import make_policy
from lidarium.benchmarks.studies.shared.kept import Progress, do_missing, kept_lines
from lidarium.benchmarks.studies.shared.study import Study
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode

POLICIES = (
    "random_walk",
    "nearest_frontier",
    "nearest_frontier_own_map",
    "utility_frontier",
    "explore_lite",
    "tour_frontier",
)
FLOORS = ("apartment", "clinic", "scene_room", "scene_loop", "scene_corridor")
TEAMS = (1, 2, 3)
SEEDS = range(3)
GOAL = 0.99
HORIZON_S = 3600.0
"""Simulated time after which a run is cut [s]."""

ENTRIES_FILE = "entries.jsonl"

PAGE = """# Policies

How long the policies take on floors of the catalogue with 1, 2 and 3 robots: simulated time until 99 % of
`C_free` were sensed, the median of three seeds; where a run ended short of that (an hour of simulated time,
or no frontier left in reach), the least coverage at the end stands instead. *Contacts* are counted over the
three runs. Kobuki, URG-04LX, perfect poses, no noise (realism `ideal`), maps of 2.5 cm; starts are drawn by
the seed, the same for all policies.

Made with `{command}`, lidarium {version}.

{table}
"""


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry of the table: a policy with a number of robots on a floor."""

    floor: str
    policy: str
    robots: int

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"{self.floor} | {self.policy} | {self.robots}"


def measure(entry: Entry) -> dict[str, Any]:
    """Run a policy on a floor once per seed; return times, coverages and contacts."""
    env = ExplorationEnv(
        entry.floor,
        make_settings(
            robots=entry.robots, starts="drawn", resolution=0.025, stop_coverage=GOAL, horizon_s=HORIZON_S
        ),
    )
    times, coverages, collisions = [], [], 0
    for seed in SEEDS:
        episode = run_episode(make_policy(entry.policy), env, seed)
        scorer = episode.env.scorer
        times.append(scorer.times.get(GOAL))
        coverages.append(scorer.coverage)
        collisions += int(env.world.collisions.sum())
    return {
        "floor": entry.floor,
        "policy": entry.policy,
        "robots": entry.robots,
        "times_s": times,
        "coverages": coverages,
        "collisions": collisions,
    }


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Run every N-th line of the table."""
    lines = [(floor, policy) for floor in FLOORS for policy in POLICIES][::every]
    entries = [Entry(floor, policy, team) for floor, policy in lines for team in TEAMS]
    yield from do_missing(folder / ENTRIES_FILE, "entries", entries, measure, workers)


def cell(line: Mapping[str, Any]) -> str:
    """Return an entry as the table shows it."""
    times, coverages, collisions = line["times_s"], line["coverages"], line["collisions"]
    reached = [value for value in times if value is not None]
    if len(reached) == len(times):
        text = f"{statistics.median(reached):.0f} s"
    else:
        text = f"{100.0 * min(coverages):.1f} %"
    return f"{text}, {collisions} contacts" if collisions else text


def table(lines: Sequence[Mapping[str, Any]]) -> str:
    """Return the table, a line for each floor and policy."""
    titles = " | ".join(f"{team} robot{'s' if team > 1 else ''}" for team in TEAMS)
    rows = [f"| floor | policy | {titles} |", "|---|---|" + "---:|" * len(TEAMS)]
    cells: dict[tuple[str, str], list[str]] = {}
    for line in lines:
        cells.setdefault((line["floor"], line["policy"]), []).append(cell(line))
    rows += [f"| {floor} | {policy} | " + " | ".join(row) + " |" for (floor, policy), row in cells.items()]
    return "\n".join(rows)


def page(folder: Path, command: str) -> str:
    """Return the results as markdown."""
    return PAGE.format(
        command=command, version=lidarium.__version__, table=table(kept_lines(folder / ENTRIES_FILE))
    )


STUDY = Study(page, work=work)
