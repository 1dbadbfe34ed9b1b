"""Makes the pages of environments, the gallery and the site: `python scripts/dev/make_gallery.py [--site FOLDER]`.

Each id and each task of lidarium-1 has a page with a film, its spaces, rewards, endings, settings and versions, and how
the reference policies do. Pages go to docs/environments, pictures to docs/images/gallery. Films that exist are
made again only with ``--films``; they take minutes. With ``--site`` the documentation is built there, for which all
notebooks are run.
"""

import argparse
import json
import math
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import gymnasium

import lidarium
from lidarium.agents.policy import Policy, settings_for
from lidarium.envs.settings.making import make_settings
from lidarium.envs.settings.rewards import RewardSettings
from lidarium.evaluation.benchmark.results import collect
from lidarium.evaluation.benchmark.tasks import Benchmark, BenchmarkTask, benchmark
from lidarium.evaluation.drawing.films import FILMS, FilmSettings, filmed, frames_of
from lidarium.evaluation.drawing.run_picture import save_floor_picture
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.report.tables import interval, markdown_table, number
from lidarium.mapping.files.output import write_text

DOCS = Path(__file__).parents[2] / "docs"
PAGES, PICTURES = DOCS / "environments", DOCS / "images" / "gallery"

WIDTH, LONGEST_S = 360, 150.0
"""Width of films [pixels], and the simulated time after which they end [s]."""

FILM = FilmSettings(speed=15.0, width=WIDTH, frames_per_second=4.0)

FLOORS = (
    "apartment",
    "clinic",
    "open_apartment",
    "robotics_laboratory",
    "signal_laboratory",
    "home_arena",
    "scene_room_corner",
    "srt_cluttered",
    "apartment:4",
    "office:11",
    "corridors:5",
    "building:17",
    "home:00",
    "dungeon:00",
    "robot_map:aaf_care_home",
)
"""Floors of the gallery."""

FLOOR, SEEDS, HORIZON_S = "apartment", 10, 600.0
"""Floor, number of starts and horizon [s] of the figures on the pages of one robot."""

OF_GYMNASIUM = {
    "Exploration": "One robot with a laser; an action is a speed and a turn rate for 0.1 s.",
    "WaypointExploration": "One robot with a laser; an action is a point near the robot, to which it drives for 2 s.",
    "FrontierExploration": "One robot with a laser; an action is one of the frontiers that it can reach.",
    "Exploration3D": "One robot with a laser and a depth camera; an action is a speed and a turn rate.",
}
"""The ids of one robot, and what they ask."""

VERSIONS = {
    "v1": "Starts drawn by the seed, `pose` only if `observe` names it, 32 frontiers of at least 0.5 m.",
    "v0": "Starts of the floor, `pose` among the observations, 16 frontiers of at least 0.1 m.",
}


@dataclass(frozen=True)
class Entry:
    """A page: an environment, the floor and the policy of its film, and what is known of it."""

    name: str
    about: str
    floor: str
    robots: int
    settings: Mapping[str, Any]
    policy: str
    shows: str = "scans"
    task: BenchmarkTask | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def id(self) -> str:
        """Its id."""
        return f"lidarium/{self.name}-v1"


def entries(found: Benchmark) -> Iterator[Entry]:
    """Yield the ids of one robot, and the tasks."""
    for name, about in OF_GYMNASIUM.items():
        options = dict(gymnasium.spec(f"lidarium/{name}-v1").kwargs)
        camera = {"camera": options["camera"]} if "camera" in options else {}
        policy = "sparse_frontier" if camera else "nearest_frontier"
        floor = "open_apartment" if camera else "apartment"
        yield Entry(name, about, floor, 1, {"starts": "drawn", **camera}, policy, options=options)
    for task in found.tasks.values():
        policy = next(each for each in ("supervised_tours", "tour_frontier", *task.policies) if each in task.policies)
        shows = "maps" if not task.settings.get("known_starts", True) else "scans"
        yield Entry(task.name, task.about, task.floors[0], task.robots, task.settings, policy, shows, task)


def film(entry: Entry, path: Path) -> None:
    """Film the policy of a page on its floor."""
    policy: Policy = lidarium.policy(entry.policy)
    given = {**entry.settings, "horizon_s": LONGEST_S, "stop_coverage": 0.99}
    env = WatchedExploration(entry.floor, settings_for(policy, make_settings(robots=entry.robots, **given)))
    with filmed(path, frames_of(entry.shows, policy, WIDTH), FILM) as taken:
        env.watchers = [taken]
        run_episode(policy, env, seed=0)
        taken.end(env)


def page(entry: Entry, found: Benchmark) -> str:
    """Return the page of an environment."""
    env = _made(entry)
    about = entry.about if entry.about.endswith(".") else f"{entry.about}."
    standings = _from_starts("camera" in entry.settings) if entry.task is None else _standings(found, entry.task)
    parts = [
        f"# {entry.name}",
        f"![{entry.policy} on {entry.floor}](../images/gallery/{entry.name}.webp)",
        f"{about[0].upper()}{about[1:]} The film shows `{entry.policy}` on `{entry.floor}`, sped up fifteen times.",
        _usage(entry),
        "## Observation",
        markdown_table(("name", "shape", "dtype", "from", "to"), _boxes(env.observation_space("robot_0"))),
        "What the arrays hold: [observations](../reference/observations.md). `observe` chooses others.",
        "## Action",
        f"`{_space(env.action_space('robot_0'))}`: [actions](../reference/environments.md#action) of the level "
        f"`{env.unwrapped.level}`. `level` chooses another.",
        "## Reward",
        _rewards(env.unwrapped.settings.reward),
        "## Ending",
        _endings(env.unwrapped.settings),
        "## Settings",
        _settings(entry),
        "## Versions",
        _versions(entry),
        "## Reference policies",
        standings,
    ]
    env.close()
    return "\n\n".join(parts) + "\n"


def _made(entry: Entry) -> Any:  # noqa: ANN401
    if entry.task is None:
        return lidarium.parallel_env(robots=1, **entry.options)
    return lidarium.parallel_env(entry.floor, robots=entry.robots, **entry.settings)


def _usage(entry: Entry) -> str:
    if entry.robots == 1:
        lines = ("import gymnasium", "import lidarium", "", f'env = gymnasium.make("{entry.id}")')
        return "\n".join(("```python", *lines, "observation, info = env.reset(seed=0)", "```"))
    lines = ("import pettingzoo", "import lidarium", "", f'env = pettingzoo.make("parallel", "{entry.id}")')
    return "\n".join(("```text", *lines, "observations, infos = env.reset(seed=0)", "```"))


def _boxes(space: Any) -> list[tuple[str, ...]]:  # noqa: ANN401
    rows: list[tuple[str, ...]] = []
    for name, box in space.spaces.items():
        shape = " x ".join(map(str, box.shape)) or "number"
        low, high = (f"{float(each):g}" for each in (box.low.min(), box.high.max()))
        rows.append((f"`{name}`", shape, str(box.dtype), low, high))
    return rows


def _space(space: Any) -> str:  # noqa: ANN401
    return str(space).replace("np.", "")


def _rewards(settings: RewardSettings) -> str:
    rows = [
        (f"`{name}`", f"{getattr(settings, name):g}")
        for name in settings.__dataclass_fields__
        if isinstance(getattr(settings, name), int | float) and getattr(settings, name)
    ]
    about = "Costs are negative terms: [rewards](../reference/environments.md#reward)."
    return f"{markdown_table(('term', 'weight'), rows)}\n\n{about}"


def _endings(settings: Any) -> str:  # noqa: ANN401
    ends = ["a policy stops its robot"]
    if settings.horizon_s is not None:
        ends.insert(0, f"{settings.horizon_s:,.0f} s of simulated time have passed (truncated)")
    if settings.stop_coverage is not None:
        ends.insert(0, f"{100.0 * settings.stop_coverage:g} % of the floor has been seen")
    return f"When {', or when '.join(ends)}."


def _settings(entry: Entry) -> str:
    floors = "" if entry.task is None else _floors(entry.task)
    rows = [
        (f"`{name}`", f"`{value}`")
        for name, value in (entry.options if entry.task is None else entry.settings).items()
        if name not in ("level", "observe")
    ]
    table = markdown_table(("option", "value"), rows) if rows else "Those of `lidarium.parallel_env`."
    return f"{floors}{table}\n\nAll options: [environments](../reference/environments.md#options)."


def _floors(task: BenchmarkTask) -> str:
    number, easy = len(task.floors), task.easy
    return f"{number} floors, `{task.floors[0]}` to `{task.floors[-1]}`; the easy size has the first {easy}.\n\n"


def _versions(entry: Entry) -> str:
    if entry.task is not None:
        return "- `v1`: floors, starts, settings and rules are frozen; hashes are checked."
    return "\n".join(f"- `{version}`: {text}" for version, text in VERSIONS.items())


def _standings(found: Benchmark, task: BenchmarkTask) -> str:
    """Return how the reference policies do on the full size, from the rows that the package ships."""
    with TemporaryDirectory() as folder:
        standings = collect(found, [task], "full", Path(folder), {}).standings
    rows = [
        (
            f"`{each.policy}`",
            f"{100.0 * each.success.estimate:.0f}",
            interval(each.time_s, float(task.settings["horizon_s"]), digits=0),
            "baseline" if each.is_baseline else interval(each.ratio, digits=3),
        )
        for each in sorted(standings, key=lambda each: each.time_s.estimate)
    ]
    header = ("policy", "runs that see 99 % [%]", "median time to 99 % [s]", "time relative to the baseline")
    command = f"`lidarium benchmark {found.name} --tasks {task.name} --policies mine:Policy`"
    return f"{markdown_table(header, rows)}\n\nBrackets contain 95 % intervals over floors. Your own policy: {command}."


@cache
def _from_starts(has_camera: bool) -> str:
    """Return how policies do by the settings of the ids of one robot, from starts drawn by the seeds."""
    policies = ("sparse_frontier",) if has_camera else ("learned", "tour_frontier", "nearest_frontier", "random_walk")
    settings = {"horizon_s": HORIZON_S, **({"camera": "xtion"} if has_camera else {})}
    rows = lidarium.evaluate(policies, floors=[FLOOR], robots=1, seeds=SEEDS, settings=settings, progress=False)
    lines = []
    for policy in policies:
        times = sorted(math.inf if row["t99_s"] is None else row["t99_s"] for row in rows if row["policy"] == policy)
        first, middle, last = (number(each, HORIZON_S, 0) for each in (times[0], median(times), times[-1]))
        share = f"{100.0 * sum(map(math.isfinite, times)) / len(times):.0f}"
        lines.append((f"`{policy}`", share, f"{middle} [{first}, {last}]"))
    header = ("policy", "runs that see 99 % [%]", "median time to 99 % [s]")
    command = f'`lidarium.evaluate("mine:Policy", robots=1, seeds={SEEDS}, settings={json.dumps(settings)})`'
    return (
        f"{markdown_table(header, lines)}\n\nFrom {SEEDS} starts on `{FLOOR}`, with the shortest and the longest time "
        f"in brackets; each policy decides at its own level. Your own policy: {command}."
    )


def index(listed: list[Entry]) -> str:
    """Return the gallery: a film of each environment, and floors."""
    parts = [
        "# Gallery",
        "Each environment has a page. Films are sped up fifteen times.",
        "## One robot, Gymnasium",
        _pictures([entry for entry in listed if entry.task is None]),
        "## Tasks of lidarium-1",
        _pictures([entry for entry in listed if entry.task is not None]),
        "## Floors",
        "Drawn, generated (`apartment:SEED`, `office:SEED`, `corridors:SEED`) and real floors: see "
        "[floors](../reference/floors.md).",
        _grid([(f"![{name}](../images/gallery/{_file(name)}.png)", f"`{name}`") for name in FLOORS]),
        "## Films",
        "`lidarium run --video --film-shows NAME`; [add one of your own](../how_to/add_a_film.md).",
        "\n".join(f"- `{name}`: {summary}" for name, summary in FILMS.summaries.items()),
        "```{toctree}\n:hidden:\n\n" + "\n".join(entry.name for entry in listed) + "\n```",
    ]
    return "\n\n".join(parts) + "\n"


def _pictures(listed: list[Entry]) -> str:
    return _grid(
        [
            (
                f"[![{entry.name}](../images/gallery/{entry.name}.webp)]({entry.name}.md)",
                f"[{entry.name}]({entry.name}.md)",
            )
            for entry in listed
        ]
    )


def _grid(cells: list[tuple[str, str]], columns: int = 3) -> str:
    """Return pictures and their names as a table of three columns."""
    lines = [f"|{' |' * columns}", f"|{'---|' * columns}"]
    for first in range(0, len(cells), columns):
        row = cells[first : first + columns]
        row += [("", "")] * (columns - len(row))
        lines += [f"| {' | '.join(part)} |" for part in zip(*row, strict=True)]
    return "\n".join(lines)


def _file(floor: str) -> str:
    return floor.replace(":", "_")


def main() -> None:
    """Make pages, films and pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], help="names of environments; all by default")
    parser.add_argument("--films", action="store_true", help="make films and pictures again that exist")
    parser.add_argument("--site", type=Path, help="build the documentation in this folder, and run its notebooks")
    given = parser.parse_args()
    PICTURES.mkdir(parents=True, exist_ok=True)
    found = benchmark("lidarium-1")
    listed = list(entries(found))
    for entry in listed:
        if given.only and entry.name not in given.only:
            continue
        path = PICTURES / f"{entry.name}.webp"
        if given.films or not path.exists():
            print(f"filming {entry.name}", flush=True)
            film(entry, path)
        write_text(PAGES / f"{entry.name}.md", page(entry, found))
    for name in FLOORS:
        path = PICTURES / f"{_file(name)}.png"
        if given.films or not path.exists():
            save_floor_picture(path, lidarium.load_floor(name), 0.3)
    write_text(PAGES / "index.md", index(listed))
    if given.site:
        build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", DOCS, given.site]
        subprocess.run(build, check=True)


if __name__ == "__main__":
    main()
