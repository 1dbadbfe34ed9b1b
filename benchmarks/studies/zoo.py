"""The study ``zoo``: teams that learned by rewards, five trainings of each, beside classic teams on unseen floors."""

import hashlib
import itertools
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.agents.catalogue import make_policy
from lidarium.agents.policy import settings_for
from lidarium.agents.supervisor.policy import Supervised
from lidarium.agents.zoo.network import network_shapes
from lidarium.agents.zoo.policy import ZooTeam, zoo_files
from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines
from lidarium.envs.floors.catalogue.names import set_floors
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.statistics import FEWEST_FOR_INTERVAL, Interval, paired_ratio
from lidarium.mapping.files.output import write_json, write_text

TEAMS = {
    "tours-2": 2,
    "ppo-2": 5,
    "mappo-2": 5,
    "vdn-2": 2,
    "qmix-2": 2,
    "ppo-4": 5,
    "mappo-4": 5,
    "qmix-4": 2,
    "signal-2": 5,
    "supervised-2": 2,
}
"""Number of trainings by team, whose own number is its size in training; two if they do not learn or take long."""

AGAIN = ("ppo-2", "0")
"""Training of a shipped network that is made again, to see what comes out on another day."""

WORLDS: Mapping[str, Mapping[str, Any]] = {"": {}, "signal": {"radio": "signal"}, "supervised": {"known_starts": False}}
"""Settings of the worlds that teams are trained for, by the first word of their name; "" is that of all others."""

WORLD_NAMES = {"signal": "Teams of 2 whose radio breaks", "supervised": "Teams of 2 under a supervisor"}

CLASSICS = ("nearest_frontier", "utility_frontier", "explore_lite", "tour_frontier", "learned", "predicted_tours")
NEAREST, TOURS, UNTRAINED, SHIPPED = "nearest_frontier", "tour_frontier", "untrained", "shipped"
BESIDE = (NEAREST, TOURS, "zoo:ppo-2")
"""Policies with which a team is compared in its own world; ppo-2 was trained in the plain one."""

FLOORS, MORE_FLOORS = set_floors("set:test:50"), set_floors("set:test")[50:]
"""Floors of all trainings, and those on which shipped teams and classic ones run besides."""

SIZES, LARGE = (2, 4), 8
"""Sizes of teams; networks of these teams drive large ones too."""

LARGE_FLOORS = 16
"""Number of floors for large teams, the first ones of the set."""

HORIZON_S, SHARE, EARLY_S = 1200.0, 0.99, 60.0

LESSONS_FILE, RUNS_FILE, LESSONS, PROCESSOR_FILE = "lessons.jsonl", "runs.jsonl", "lessons", "processor.json"
CURVE, WEIGHTS, CURVES_PICTURE = "curve.csv", "weights.safetensors", "zoo_curves.png"

PAGE = """# The zoo

## What is compared

[Teams of the zoo](../reference/learned.md#teams-of-the-zoo) choose among frontiers, `tours-2` among the stops of its
tours, in the ideal world. The best network of each training by the validation floors runs here. The untrained network
ranks frontiers as explore_lite does; before its training `tours-2` does as `tour_frontier`. All run on the same
{floors} floors of the set `test` from the starts of the floors, and shipped teams and classic policies on {all_floors},
until 99 % is seen or {horizon:.0f} s are over, which then count. Classic policies decide at their own level. Ratios
are geometric means of times over the floors that all trainings have, with 95 % intervals over floors: they are those of
these trainings, and other seeds may lie beyond them. The best team is chosen on the same floors.

## Figures

{goals}

{tables}

{whole}## Teams of eight

Networks of smaller teams, with 8 robots.

{large}

{worlds}

## By training

{by_seed}

## Curves

![Coverage on the validation floors]({picture})

Coverage on the validation floors, mean over the time of an episode of 120 s; thin lines are single trainings, and a
band comes with five.

{curves}
"""


@dataclass(frozen=True, slots=True)
class Lesson(Task):
    """A training of a team from a seed."""

    team: str
    seed: int
    folder: Path


@dataclass(frozen=True, slots=True)
class Run(Task):
    """An episode of a policy; of teams of the zoo with the weights of a training."""

    policy: str
    training: str
    floor: str
    robots: int
    weights: Path | None
    world: str = ""
    digest: str = field(init=False)
    """Beginning of the hash of the weights: other weights are another task."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "digest", "" if self.weights is None else _digest(self.weights))


@cache
def _digest(weights: Path) -> str:
    return hashlib.sha256(weights.read_bytes()).hexdigest()[:8]


def learn(lesson: Lesson) -> dict[str, Any]:
    """Train a team; return the processor time that it took, in all calls."""
    from lidarium.training.settings import TeamSettings, read_any_training
    from lidarium.training.teams.training import TeamTraining

    settings = read_any_training(Path(str(resources.files("lidarium.training.teams") / "data" / f"{lesson.team}.toml")))
    assert isinstance(settings, TeamSettings)
    kept = lesson.folder / PROCESSOR_FILE
    before = float(json.loads(kept.read_text(encoding="utf-8"))["seconds"]) if kept.exists() else 0.0
    began, spent = time.process_time() - before, before
    for _ in TeamTraining(replace(settings, seed=lesson.seed), lesson.folder).run():
        spent = time.process_time() - began
        write_json(kept, {"seconds": spent})
    return {"team": lesson.team, "seed": lesson.seed, "processor_s": spent}


def _curve(path: Path) -> list[list[float]]:
    """Return the points of a training's curve: decisions and coverage."""
    lines = (path / CURVE).read_text(encoding="utf-8").splitlines()[1:]
    return [[int(step), float(coverage)] for step, coverage in (line.split(",") for line in lines)]


def _trainings(folder: Path) -> dict[tuple[str, str], Path]:
    """Return the folders of finished trainings by team and seed, in the order of the teams."""
    lines = kept_lines(folder / LESSONS_FILE) if (folder / LESSONS_FILE).exists() else []
    finished = {(line["team"], str(line["seed"])) for line in lines}
    found = {
        (team, path.name.rpartition("-")[2]): path
        for team in TEAMS
        for path in sorted((folder / LESSONS).glob(f"{team}-*"))
    }
    return {key: path for key, path in found.items() if key in finished or key[1] == SHIPPED}


def _level(team: str) -> str:
    return "tour" if "tours" in team else "frontier"


def _card(team: str) -> Traversable:
    """Return the card of a team that ships, a file that others lack."""
    return resources.files("lidarium.agents.zoo") / "data" / f"{team}.json"


def _first_training(policy: str) -> str:
    """Return the training of a team of the zoo that runs where not all do."""
    return SHIPPED if _card(policy.removeprefix("zoo:")).is_file() else "0"


def _take_shipped(folder: Path) -> None:
    """Write the shipped weights and curves."""
    for team in TEAMS:
        card = _card(team)
        if not card.is_file():
            continue
        taken = folder / LESSONS / f"{team}-{SHIPPED}"
        taken.mkdir(parents=True, exist_ok=True)
        curve = json.loads(card.read_text(encoding="utf-8"))["curve"]
        write_text(taken / CURVE, "step,coverage\n" + "".join(f"{step},{coverage}\n" for step, coverage in curve))
        files = zoo_files(team, _level(team))
        files.save(taken / WEIGHTS, files.load(""))


def measure(run: Run) -> dict[str, Any]:
    """Run an episode; return its figures."""
    policy = make_policy(run.policy) if run.weights is None else ZooTeam(run.policy, run.weights, _level(run.policy))
    policy = Supervised(policy) if run.world == "supervised" else policy
    settings = settings_for(
        policy, make_settings(robots=run.robots, stop_coverage=SHARE, horizon_s=HORIZON_S, **WORLDS[run.world])
    )
    history = History()
    run_episode(policy, WatchedExploration(run.floor, settings, watchers=[history]), 0)
    curves = history.curves
    seen = np.flatnonzero(curves.c_free >= SHARE)
    return {
        **{name: getattr(run, name) for name in ("policy", "training", "floor", "robots", "world")},
        "early": float(np.interp(EARLY_S, curves.times, curves.c_free)),
        "time_s": float(curves.times[seen[0]]) if len(seen) else None,
        "joined_s": next((join.time_s for join in policy.joins), None) if isinstance(policy, Supervised) else None,
    }


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Train all teams, and compare them with classic ones on every N-th floor.

    Shipped weights are the trainings of seed 0. A part of the study trains nothing else.
    """
    floors = FLOORS[::every]
    _take_shipped(folder)
    if every == 1:
        lessons = [
            Lesson(team, seed, folder / LESSONS / f"{team}-{seed}")
            for team, number in TEAMS.items()
            for seed in range(number)
            if seed or (team, "0") == AGAIN or not _card(team).is_file()
        ]
        yield from do_missing(folder / LESSONS_FILE, "lessons", lessons, learn, workers)
    untrained = folder / f"{UNTRAINED}.safetensors"
    zeros = {name: np.zeros(shape, np.float32) for name, shape in network_shapes("frontier").items()}
    zoo_files("").save(untrained, {**zeros, "steepness": np.ones(1, np.float32)})
    teams: list[tuple[str, str, Path | None]] = [(name, "", None) for name in CLASSICS]
    teams += [(UNTRAINED, "", untrained)]
    zoo = [(f"zoo:{team}", seed, trained / WEIGHTS) for (team, seed), trained in _trainings(folder).items()]
    teams += [team for team in zoo if not _world(team[0])]
    runs = [
        Run(name, training, floor, robots, weights)
        for floor in floors
        for robots in SIZES
        for name, training, weights in teams
        if not name.startswith("zoo:") or _size(name) == robots
    ]
    first = [team for team in teams if not team[0].startswith("zoo:") or team[1] == _first_training(team[0])]
    runs += [
        Run(name, training, floor, LARGE, weights)
        for floor in floors[:LARGE_FLOORS]
        for name, training, weights in first
        if name not in CLASSICS or name in (NEAREST, TOURS)
    ]
    runs += [
        Run(name, training, floor, robots, weights)
        for floor in MORE_FLOORS[::every]
        for robots in SIZES
        for name, training, weights in first
        if not name.startswith("zoo:") or (_size(name) == robots and training == SHIPPED)
    ]
    for own in filter(_world, TEAMS):
        beside: list[tuple[str, str, Path | None]] = [(name, "", None) for name in BESIDE]
        runs += [
            Run(name, training, floor, _size(own), weights, _world(own))
            for floor in floors
            for name, training, weights in (*beside, *(team for team in zoo if team[0] == f"zoo:{own}"))
        ]
    yield from do_missing(folder / RUNS_FILE, "runs", runs, measure, workers)


Line = Mapping[str, Any]


def _size(name: str) -> int:
    """Return the size of the team in the training of a team of the zoo."""
    return int(name.rpartition("-")[2])


def _world(name: str) -> str:
    """Return the world that a team of the zoo is trained for."""
    first = name.removeprefix("zoo:").partition("-")[0]
    return first if first in WORLDS else ""


def _seconds(line: Line) -> float:
    return HORIZON_S if line["time_s"] is None else float(line["time_s"])


def _ratio(ours: Sequence[Line], others: Sequence[Line]) -> Interval | None:
    """Return the geometric mean of the ratios of times on the floors that both have, and all trainings.

    Floors count alike, each by the geometric mean of its runs.
    """
    known = {line["floor"]: _seconds(line) for line in others}
    trainings = {line["training"] for line in ours}
    by_floor: dict[str, list[Line]] = {}
    for line in ours:
        by_floor.setdefault(line["floor"], []).append(line)
    logs = {
        floor: [math.log(_seconds(line)) for line in each]
        for floor, each in by_floor.items()
        if floor in known and {line["training"] for line in each} == trainings
    }
    if len(logs) < 2:
        return None
    return paired_ratio([math.exp(np.mean(each)) for each in logs.values()], [known[floor] for floor in logs])


def _mean(lines: Sequence[Line], of: Callable[[Line], float]) -> float:
    return float(np.mean([of(line) for line in lines]))


def _slowness(policy: str, found: Mapping[str, Sequence[Line]]) -> float:
    """Return the mean logarithm of the times of a policy over those of nearest frontiers, on the floors of both."""
    known = {line["floor"]: math.log(_seconds(line)) for line in found.get(NEAREST, [])}
    excess = [math.log(_seconds(line)) - known[line["floor"]] for line in found[policy] if line["floor"] in known]
    return float(np.mean(excess)) if excess else math.inf


def _by_policy(lines: Sequence[Line], robots: int, world: str = "") -> dict[str, list[Line]]:
    """Return the runs of teams of a size in a world, by policy."""
    found: dict[str, list[Line]] = {}
    for line in lines:
        if line["robots"] == robots and line["world"] == world:
            found.setdefault(line["policy"], []).append(line)
    return found


def _named(policy: str) -> str:
    return "untrained network" if policy == UNTRAINED else f"`{policy}`"


def _written(ratio: Interval | None) -> str:
    return "-" if ratio is None else f"{ratio:.2f}"


def _table(found: Mapping[str, Sequence[Line]]) -> str:
    """Return the table of teams of a size, fastest first."""
    rows = []
    for policy in sorted(found, key=lambda name: _slowness(name, found)):
        lines = found[policy]
        over = [_written(_ratio(lines, found.get(other, []))) if other != policy else "-" for other in (NEAREST, TOURS)]
        reached = sum(line["time_s"] is not None for line in lines)
        rows.append(
            f"| {_named(policy)} | {len(lines)} | {100 * _mean(lines, lambda line: line['early']):.1f} % "
            f"| {np.median([_seconds(line) for line in lines]):.1f} s | {over[0]} | {over[1]} | {reached} |"
        )
    header = (
        f"| policy | runs | seen after {EARLY_S:.0f} s, mean | time to 99 %, median | time over `{NEAREST}` "
        f"| time over `{TOURS}` | reached 99 % |\n|---|---:|---:|---:|---:|---:|---:|"
    )
    return "\n".join([header, *rows])


def _on_all_floors(lines: Sequence[Line]) -> str:
    """Return the section of shipped teams and classic policies on all floors, none if no more floors ran."""
    if not lines:
        return ""
    tables = "\n\n".join(f"Teams of {robots}:\n\n{_table(_by_policy(lines, robots))}" for robots in SIZES)
    number = len({line["floor"] for line in lines})
    goals = "\n".join([GOALS, *_goals(lines, SIZES)])
    return f"## All floors\n\nShipped teams and classic policies on {number} floors.\n\n{goals}\n\n{tables}\n\n"


def _worlds(lines: Sequence[Line]) -> str:
    """Return the tables of the worlds that some teams were trained for."""
    parts = []
    for world, title in WORLD_NAMES.items():
        found = _by_policy(lines, 2, world)
        if not found:
            continue
        parts.append(f"## {title}\n\n{_table(found)}")
        if world == "supervised":
            rows = []
            for name, each in found.items():
                times = [line["joined_s"] for line in each if line["joined_s"] is not None]
                after = f"{np.median(times):.1f} s" if times else "-"
                rows.append(f"| {_named(name)} | {len(times)} of {len(each)} | {after} |")
            header = "| policy | joined | after, median |\n|---|---:|---:|"
            parts.append("\n".join(["The station joined the maps of both robots:\n", header, *rows]))
    return "\n\n".join(parts)


def _best(found: Mapping[str, Sequence[Line]], is_by_tours: bool) -> str | None:
    """Return the team of the zoo at a level that takes least time, over all its trainings."""
    teams = [name for name in found if name.startswith("zoo:") and ("tours" in name) == is_by_tours]
    return min(teams, key=lambda name: _slowness(name, found), default=None)


GOALS = "| figure | to reach | measured | reached |\n|---|---:|---:|---|"


def _goals(lines: Sequence[Line], sizes: Sequence[int]) -> list[str]:
    """Return a row for each figure that was to be reached, of teams of some sizes."""
    rows = []
    for robots, is_by_tours in itertools.product(sizes, (False, True)):
        found = _by_policy(lines, robots)
        best = _best(found, is_by_tours)
        if best is None:
            continue
        for other in (NEAREST, "utility_frontier", "explore_lite", TOURS):
            ratio = _ratio(found[best], found.get(other, []))
            if ratio is None or (robots == LARGE and other != NEAREST):
                continue
            sure = ratio.size >= FEWEST_FOR_INTERVAL
            if other == TOURS:
                goal, said = ("at most 1", _said(ratio.estimate <= 1.0, sure)) if is_by_tours else ("published", "-")
            elif robots == LARGE:
                goal, said = "at most 1", _said(ratio.estimate <= 1.0, sure)
            elif other == NEAREST:
                goal, said = "at most 0.90, interval below 1", _said(ratio.estimate <= 0.9 and ratio.high < 1.0, sure)
            else:
                goal, said = "interval below 1", _said(ratio.high < 1.0, sure)
            rows.append(f"| {robots} robots, `{best}` over `{other}` | {goal} | {_written(ratio)} | {said} |")
        if robots != LARGE:
            reached = [_mean(found[name], lambda line: line["time_s"] is not None) for name in (best, NEAREST)]
            rows.append(
                f"| {robots} robots, `{best}`: runs that reach 99 % | as many as `{NEAREST}` "
                f"| {100 * reached[0]:.1f} % ({100 * reached[1]:.1f} %) | {_said(reached[0] >= reached[1], True)} |"
            )
    return rows


def _again(folder: Path, runs: Sequence[Line]) -> Iterator[str]:
    """Yield a row for the training that was made again: its time over the nearest frontier, and that of the others."""
    team, seed = AGAIN
    found, robots = _by_policy(runs, _size(team)), _size(team)
    ratios: dict[str, float] = {}
    for training in {line["training"] for line in found.get(f"zoo:{team}", [])}:
        own = [line for line in found[f"zoo:{team}"] if line["training"] == training]
        if ratio := _ratio(own, found.get(NEAREST, [])):
            ratios[training] = ratio.estimate
    again = ratios.pop(seed, None)
    ratios.pop(SHIPPED, None)  # the same seed
    if again is None or len(ratios) < 2:
        return
    low, high = min(ratios.values()), max(ratios.values())
    weights = [(folder / LESSONS / f"{team}-{each}" / WEIGHTS).read_bytes() for each in (seed, SHIPPED)]
    same = ", the same weights to the byte" if weights[0] == weights[1] else ""
    yield (
        f"| {robots} robots, `{team}` trained again from the shipped seed | within {low:.2f} to {high:.2f}, as other "
        f"seeds | {again:.2f}{same} | {_said(low <= again <= high, True)} |"
    )


def _said(is_reached: bool, is_sure: bool) -> str:
    """Return whether a figure was reached; few floors do not tell that it was."""
    if not is_reached:
        return "**no**"
    return "yes" if is_sure else "too few floors"


def _seed_rows(lines: Sequence[Line], lessons: Sequence[Line]) -> str:
    """Return the time over that of the nearest frontier by training."""
    rows = []
    for lesson in lessons:
        curve = lesson["curve"]
        robots = _size(lesson["team"])
        found = _by_policy(lines, robots, _world(lesson["team"]))
        own = [line for line in found.get(f"zoo:{lesson['team']}", []) if line["training"] == str(lesson["seed"])]
        best = max(curve[1:], key=lambda entry: entry[1])
        spent = "-" if lesson["processor_s"] is None else f"{lesson['processor_s'] / 60:.1f} min"
        rows.append(
            f"| `{lesson['team']}` | {lesson['seed']} | {curve[-1][0]:,} | {100 * curve[0][1]:.1f} % "
            f"| {100 * best[1]:.1f} % | {_written(_ratio(own, found.get(NEAREST, [])))} "
            f"| {spent} |"
        )
    header = (
        "| team | seed | decisions | validation before | best | time over `nearest_frontier` | processor time |\n"
        "|---|---:|---:|---:|---:|---:|---:|"
    )
    return "\n".join([header, *rows])


def _lessons(folder: Path) -> list[dict[str, Any]]:
    """Return the trainings in the order of the teams; processor times are known of those made by the study."""
    timed = kept_lines(folder / LESSONS_FILE) if (folder / LESSONS_FILE).exists() else []
    spent = {(line["team"], str(line["seed"])): line["processor_s"] for line in timed}
    return [
        {"team": team, "seed": seed, "curve": _curve(path), "processor_s": spent.get((team, seed))}
        for (team, seed), path in _trainings(folder).items()
    ]


def _curve_rows(lessons: Sequence[Line]) -> str:
    """Return the mean curve of each team at a few points."""
    rows = ["| decisions | " + " | ".join(f"`{team}`" for team in TEAMS) + " |", "|---:|" + "---:|" * len(TEAMS)]
    own = [line for line in lessons if (line["team"], line["seed"]) != AGAIN]
    curves = {team: [dict(map(tuple, line["curve"])) for line in own if line["team"] == team] for team in TEAMS}
    for step in sorted({step for found in curves.values() for each in found for step in each}):
        cells = [
            f"{100 * np.mean([each[step] for each in curves[team]]):.1f} %"
            if curves[team] and all(step in each for each in curves[team])
            else "-"
            for team in TEAMS
        ]
        rows.append(f"| {step:,} | " + " | ".join(cells) + " |")
    return "\n".join(rows)


def page(folder: Path) -> str:
    """Return the results as markdown."""
    runs, lessons = kept_lines(folder / RUNS_FILE), _lessons(folder)
    few = [line for line in runs if line["floor"] in FLOORS]
    lines = [line for line in few if (line["policy"].removeprefix("zoo:"), line["training"]) != AGAIN]
    whole = [line for line in runs if line["training"] in ("", SHIPPED)] if len(few) < len(runs) else []
    return PAGE.format(
        floors=len({line["floor"] for line in lines}),
        all_floors=len({line["floor"] for line in whole or lines}),
        horizon=HORIZON_S,
        goals="\n".join([GOALS, *_goals(lines, (*SIZES, LARGE)), *_again(folder, few)]),
        whole=_on_all_floors(whole),
        tables="\n\n".join(f"## Teams of {robots}\n\n{_table(_by_policy(lines, robots))}" for robots in SIZES),
        large=_table(_by_policy(lines, LARGE)),
        worlds=_worlds(lines),
        by_seed=_seed_rows(few, lessons),
        picture=CURVES_PICTURE,
        curves=in_file(_curve_rows(lessons)),
    )


def pictures(folder: Path, out: Path) -> None:
    """Draw the curves of all teams over the seeds."""
    from lidarium.evaluation.analysis.learning_curves import joined
    from lidarium.evaluation.drawing.curves_picture import save_learning_curves

    trained = {key: path for key, path in _trainings(folder).items() if key != AGAIN}
    curves = [
        joined(team, paths, "step", "coverage")
        for team in TEAMS
        if (paths := [path / CURVE for (name, _), path in trained.items() if name == team])
    ]
    save_learning_curves(out / CURVES_PICTURE, curves, "decisions", "coverage")


STUDY = Study(page, work=work, pictures=pictures, quick=25)
"""The study of teams that learned by rewards."""
