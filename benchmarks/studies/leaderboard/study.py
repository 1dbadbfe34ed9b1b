"""The leaderboard: all policies on generated and real floors, in worlds that are more or less real."""

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.leaderboard.pairs import merges_text, pairs_table
from lidarium.benchmarks.studies.leaderboard.tables import Multiples, Part, short_table, table
from lidarium.benchmarks.studies.leaderboard.worlds import (
    BOUNDED,
    KINDS,
    WORLDS,
    floors_of,
    parts,
    suites,
)
from lidarium.benchmarks.studies.shared.study import (
    HORIZON_S,
    SETTINGS,
    TEAMS,
    Bounded,
    Progress,
    Study,
    do_missing,
    kept_lines,
    measure_bound,
)
from lidarium.evaluation.analysis.figures import over_bound
from lidarium.evaluation.report import write_report
from lidarium.evaluation.suites.campaign import EPISODES_FILE
from lidarium.evaluation.suites.episodes_file import KEY, read_episodes
from lidarium.mapping.files.output import write_text

BOUNDS_FILE = "bounds.jsonl"
ALL = "all"
"""Folder of the episodes of all kinds and worlds, for the page that a browser shows."""

README_TEAM = 3
"""Number of robots of the table in the README."""

BEGIN, END = "<!-- leaderboard -->", "<!-- end of the leaderboard -->"
"""Between these lines of the README is its table."""

PAGE = """# Leaderboard

To sort and filter it, save [leaderboard.html](leaderboard.html) and open it in a browser.

Simulated time; Kobuki, the URG laser (240 deg, 5.6 m), maps of 5 cm, cut at {horizon:.0f} s. Starts are drawn by the
seed, the same for every policy. The world *ideal* has perfect poses, no noise and known starts; *lab* has SLAM on
noisy scans and odometry; with *unknown starts* robots find out by their maps where the others are. *By camera*
robots explore by depth cameras; the floor counts as seen by lasers, as everywhere.

Times are medians with 95 % intervals; runs that did not get there count as never. Multiples are of the time of a team
that [knows the floor](../reference/bounds.md), medians over floors that have a bound. Differences are of restricted
means to the baseline of the world (`nearest_frontier`, or `independent` if starts are unknown), pair by pair, for six
pairs or more; they are bold if both Wilcoxon's signed rank test (5 %, Holm) and the 95 % interval exclude chance.

Pairs of policies are compared by geometric means of ratios of times to 99 %, with their 95 % interval. Below 1 is
less time; runs that did not get there count as the whole time.{merges}
{notes}
{kinds}
"""


def work(folder: Path, data: Path | None, every: int, workers: int) -> Progress:
    """Bound a part of the floors."""
    floors = floors_of(data, every)
    teams = [
        Bounded(floor, robots, SETTINGS)
        for kind, nth in BOUNDED.items()
        for floor in floors.get(kind, ())[::nth]
        for robots in TEAMS
    ]
    yield from do_missing(folder / BOUNDS_FILE, "bounds", teams, measure_bound, workers)


def page(folder: Path) -> str:
    """Return the leaderboard as markdown; each suite's report goes into its folder."""
    found = _parts_in(folder)
    notes = []
    if missing := _missing(folder, found):
        notes.append(f"Not in it: {'; '.join(missing)}.")
    return PAGE.format(
        horizon=HORIZON_S,
        merges=merges_text(each for kind in KINDS for each in _episodes(folder, kind, "unknown")),
        notes="".join(f"\n{note}\n" for note in notes),
        kinds="\n\n".join(_section(folder, kind, kind_parts) for kind, kind_parts in found.items()),
    )


def beside(folder: Path, out: Path) -> None:
    """Write the page for browsers besides the other, and the README's table if there is one."""
    write_text(out / "leaderboard.html", _browser_page(folder).read_text(encoding="utf-8"))
    readme = out.resolve().parent.parent / "README.md"
    text = readme.read_text(encoding="utf-8") if readme.is_file() else ""
    found = _parts_in(folder)
    if BEGIN in text and END in text and "test" in found:
        before, rest = text.split(BEGIN, 1)
        after = rest.split(END, 1)[1]
        write_text(readme, f"{before}{BEGIN}\n\n{short_table(found['test'], README_TEAM)}\n\n{END}{after}")


def _episodes(folder: Path, kind: str, world: str) -> list[dict[str, Any]]:
    path = folder / f"{kind}_{world}" / EPISODES_FILE
    return read_episodes(path) if path.exists() else []


def _missing(folder: Path, found: Mapping[str, Any]) -> list[str]:
    """Return which kinds of floors did not run, and which worlds of kinds that did."""
    worlds = [
        f"{KINDS[kind]} in the world {world.about}"
        for kind, name, world in parts()
        if kind in found and not (folder / f"{kind}_{name}" / EPISODES_FILE).exists()
    ]
    return [about for kind, about in KINDS.items() if kind not in found] + worlds


def _section(folder: Path, kind: str, found: list[Part]) -> str:
    floors = {floor for part in found for group in part.groups for floor in group["floors"]}
    about = KINDS[kind]
    pairs = pairs_table(
        {name: _episodes(folder, kind, name) for name in WORLDS},
        {name: world.about for name, world in WORLDS.items()},
    )
    blocks = (f"## {about[0].upper()}{about[1:]} ({len(floors)})", pairs, in_file(table(found)))
    return "\n\n".join(block for block in blocks if block)


def _parts_in(folder: Path) -> dict[str, list[Part]]:
    """Return what has run, by kind of floor."""
    bounds = _bounds_in(folder)
    found: dict[str, list[Part]] = {}
    for kind, name, world in parts():
        path = folder / f"{kind}_{name}"
        if (path / EPISODES_FILE).exists():
            groups = _report(path, world.policies[0])["groups"]
            multiples = _multiples(path, bounds)
            found.setdefault(kind, []).append(Part(world, groups, multiples))
    return found


def _report(path: Path, baseline: str) -> dict[str, Any]:
    """Return the numbers of a report, which is written if the episodes are newer."""
    episodes, made = path / EPISODES_FILE, path / "report" / "report.json"
    if made.exists() and made.stat().st_mtime > episodes.stat().st_mtime:
        return dict(json.loads(made.read_text(encoding="utf-8")))
    return write_report(path, path / "report", baseline)


def _bounds_in(folder: Path) -> dict[tuple[str, int], float]:
    path = folder / BOUNDS_FILE
    lines = kept_lines(path) if path.exists() else []
    return {(line["floor"], line["robots"]): line["known_s"] for line in lines if line["known_s"]}


def _multiples(path: Path, bounds: Mapping[tuple[str, int], float]) -> Multiples:
    """Return medians of multiples of the bound."""
    found: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for episode in _bounded(read_episodes(path / EPISODES_FILE), bounds):
        found.setdefault((episode["policy"], episode["robots"]), []).append(episode)
    multiples = {key: over_bound(rows, HORIZON_S) for key, rows in found.items()}
    return {key: found.ratio.estimate for key, found in multiples.items() if found is not None}


def _bounded(episodes: Iterable[dict[str, Any]], bounds: Mapping[tuple[str, int], float]) -> Iterator[dict[str, Any]]:
    """Yield episodes with the bound of their floor and team, if it is known."""
    for episode in episodes:
        # Floors by the names that were asked for; `building:3000000` calls itself by its kind.
        team = episode[KEY].split(" | ")[1], episode["robots"]
        yield {**episode, **({"bound_s": bounds[team]} if team in bounds else {})}


def _browser_page(folder: Path) -> Path:
    """Return the report page of all episodes, each with its kind of floor and world as its settings."""
    lines, bounds = [], _bounds_in(folder)
    for kind, name, world in parts():
        variant = f"{world.about}: {KINDS[kind].partition(',')[0]}"
        for episode in _bounded(_episodes(folder, kind, name), bounds):
            key = " | ".join([variant, *episode[KEY].split(" | ")[1:]])
            lines.append(json.dumps({**episode, KEY: key, "variant": variant}))
    write_text(folder / ALL / EPISODES_FILE, "\n".join(lines) + "\n")
    write_report(folder / ALL, folder / ALL / "report")
    return folder / ALL / "report" / "report.html"


STUDY = Study(page, suites, work, beside, quick=200, needs={"bounds": ("ortools",)})
