"""Every real floor, dungeons and 200 generated floors, explored by 1 to 3 robots."""

import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import lidarium
from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines, real_floors
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode

POLICY = "nearest_frontier"
TEAMS = (1, 2, 3)
RUNS_FILE = "runs.jsonl"

KINDS = {
    "kth": "KTH campus floors (XML, conn >= 0.8)",
    "lifull": "LIFULL apartments (vectors)",
    "slam": "real SLAM maps (ROS yaml)",
    "dungeon": "dungeon maps (PNG)",
    "generated": "generated floors (building:SEED)",
}
GENERATED = range(4_000_000, 4_000_200)

Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Run(Task):
    """A floor of some kind that a number of robots explore."""

    kind: str
    floor: str
    robots: int

    @property
    def key(self) -> str:
        """Name that no other one of its file has."""
        return f"{self.kind} | {name_of(self.floor)} | {self.robots}"


def floors(data: Path | None) -> list[tuple[str, str]]:
    """Return (kind, floor) of all that is explored. Without data these are generated floors alone."""
    found = {} if data is None else real_floors(data)
    return [(kind, str(path)) for kind, paths in found.items() for path in paths] + [
        ("generated", f"building:{seed}") for seed in GENERATED
    ]


def name_of(floor: str) -> str:
    """Return the floor's name without its folder."""
    return Path(floor).name.split(".")[0] if "/" in floor else floor


def explore(run: Run) -> dict[str, Any]:
    """Run an episode without a horizon. Returns its figures, or why it could not start."""
    row = {"kind": run.kind, "floor": name_of(run.floor), "robots": run.robots, "policy": POLICY}
    began = time.perf_counter()
    try:
        env = ExplorationEnv(run.floor, make_settings(robots=run.robots, resolution=0.025, horizon_s=None))
        episode = run_episode(lidarium.policy(POLICY), env, seed=0)
    except ValueError as error:
        return {**row, "error": str(error)}
    scorer, world = env.scorer, env.world
    return {
        **row,
        "area_m2": round(float(env.score.counted[0]) * 0.025**2, 1),
        "coverage": round(scorer.coverage, 5),
        "time_s": round(scorer.time, 1),
        "path_m": round(float(world.travelled.sum()), 1),
        "collisions": int(world.collisions.sum()),
        "ended": sorted(set(scorer.ended_because.values())),
        "given_up": len(episode.given_up),
        "wall_s": round(time.perf_counter() - began, 2),
    }


def work(folder: Path, data: Path | None, every: int, workers: int) -> Progress:
    """Explore every N-th pair of floor and team."""
    runs = [Run(kind, floor, robots) for kind, floor in floors(data) for robots in TEAMS][::every]
    yield from do_missing(folder / RUNS_FILE, "runs", runs, explore, workers)


def page(folder: Path) -> str:
    """Return the results as markdown."""
    rows = kept_lines(folder / RUNS_FILE)
    runs = [row for row in rows if "error" not in row]
    refused = [row for row in rows if "error" in row]
    missed = [row for row in runs if row["coverage"] < 0.99 or row["collisions"]]
    lines = [
        "# Every floor, explored",
        "",
        f"Policy `{POLICY}`, Kobuki (radius 0.18 m), URG-04LX (727 beams, 240 degrees, 5.6 m), true poses, no noise, "
        "world and maps at 0.025 m, no horizon, seed 0. A run ends as `covered` when 0.99 of `C_free` is sensed. Area, "
        "time, path of the team and wall time are medians, the last three of teams of 1, 2 and 3 robots.",
        "",
        *_summary(runs),
        "",
        f"## Misses\n\n{len(missed)} of {len(runs)} runs below 0.99 or with a collision.",
        "",
    ]
    lines += [
        f"- {row['floor']}, {row['robots']} robots: coverage {row['coverage']:.4f}, collisions "
        f"{row['collisions']}, ended {row['ended']}"
        for row in missed
    ]
    lines += ["", "## Floors that the robots do not fit in", ""]
    lines += [f"- {row['floor']}, {row['robots']} robots: {row['error']}" for row in refused] or ["None."]
    lines += ["", "## All runs", "", "Coverage / time in s / path of the team in m.", ""]
    lines += [in_file("\n".join(_all_runs(runs)))]
    return "\n".join(lines) + "\n"


def _summary(runs: Sequence[Row]) -> list[str]:
    """Return a table with a line for each kind of floor."""
    lines = [
        "| floors | runs | missed 0.99 | collisions | area [m2] | time [s] | path [m] | wall [s] |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for kind, title in KINDS.items():
        chosen = [row for row in runs if row["kind"] == kind]
        if not chosen:
            continue
        teams = [[row for row in chosen if row["robots"] == robots] for robots in TEAMS]
        medians = [
            ", ".join(f"{median(row[name] for row in team):.{digits}f}" if team else "-" for team in teams)
            for name, digits in (("time_s", 0), ("path_m", 0), ("wall_s", 1))
        ]
        cells = [title, len(chosen), sum(row["coverage"] < 0.99 for row in chosen)]
        cells += [sum(row["collisions"] for row in chosen), f"{median(row['area_m2'] for row in chosen):.0f}", *medians]
        lines.append(f"| {' | '.join(str(cell) for cell in cells)} |")
    return lines


def _all_runs(runs: Sequence[Row]) -> list[str]:
    """Return a table with a line for each floor."""
    by_floor: dict[tuple[str, str], dict[int, Row]] = defaultdict(dict)
    for row in runs:
        by_floor[row["kind"], row["floor"]][row["robots"]] = row
    lines = ["| floor | m2 | 1 robot | 2 robots | 3 robots |", "|---|---|---|---|---|"]
    for (_, floor), cells in sorted(by_floor.items(), key=lambda item: (list(KINDS).index(item[0][0]), item[0][1])):
        area = next(iter(cells.values()))["area_m2"]
        shown = [
            f"{cells[robots]['coverage']:.3f} / {cells[robots]['time_s']:.0f} / {cells[robots]['path_m']:.0f}"
            if robots in cells
            else "-"
            for robots in (1, 2, 3)
        ]
        lines.append(f"| {floor} | {area} | {' | '.join(shown)} |")
    return lines


STUDY = Study(page, work=work)
