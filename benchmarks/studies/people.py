"""The study ``people``: reference policies among people and doors, beside the same floors without."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.agents.catalogue import make_policy
from lidarium.agents.policy import settings_for
from lidarium.benchmarks.studies.shared.study import Progress, Study, Task, do_missing, kept_lines
from lidarium.envs.engine.engine import Engine
from lidarium.envs.levels.level import STEPS
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.history import History
from lidarium.evaluation.episodes.result import EpisodeData, figures_of
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.statistics.estimates import paired_ratio

EXPLORERS = (
    "nearest_frontier",
    "utility_frontier",
    "explore_lite",
    "srt",
    "sparse_frontier",
    "tour_frontier",
    "learned",
)
POLICIES = (*EXPLORERS, "random_walk")
"""The reference policies of the benchmark; the last one does not explore to an end."""

FLOORS = tuple(f"office:{seed}" for seed in range(1, 6))
SEEDS: dict[str, int] = {
    "nearest_frontier": 9,
    "utility_frontier": 9,
    "explore_lite": 9,
    "srt": 1,
    "sparse_frontier": 1,
    "tour_frontier": 3,
    "learned": 3,
    "random_walk": 9,
}
"""Number of seeds of each policy: those that take long to plan have fewer."""

PAIRED, WITH_DOORS = 3, 2
"""Seeds that run without people, too, and with doors as well."""

ROBOTS, PEOPLE, DOORS = 3, 8, 0.5
HORIZON_S = 900.0

SLAM_SEEDS = range(3)
"""Seeds of the runs with SLAM, on the first two floors."""

BATCH, TIMED, REPEATS = 32, 100, 9
"""Episodes and steps of a batch that is timed, and how often."""

FIGURES = (
    "t99_s",
    "coverage_final",
    "iou_occupied",
    "collisions",
    "near_misses",
    "closest_approach_m",
    "time_near_people_s",
    "speed_near_people_m_s",
    "contacts_by_robot",
    "contacts_by_person",
    "yielding_s",
    "ate_m",
)

RUNS_FILE, SLAM_FILE, STEPS_FILE = "runs.jsonl", "slam.jsonl", "steps.jsonl"

PAGE = """# People and doors

{robots} robots on {floors} generated office floors, with {people} people and without. People walk between places by
ORCA ([people and doors](../how_to/people_and_doors.md)).

| figure | to reach | measured | reached |
|---|---:|---:|---|
{goals}

## Policies

Times to 99 % of the floor; misses count with {horizon:.0f} s. Ratios are geometric means over pairs with 95 %
intervals. *Near misses*: approaches below 0.5 m in a run; *near* and *lost* (by yielding): time of a robot in a run;
*contacts*: by robots, by people.

| policy | runs | pairs | with over without | 99 % | contacts | near misses | near [s] | closest [m] | lost [s] |
|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|
{policies}

With doors in {doors:.0f} % of the openings as well:

| policy | runs | with over without | reached 99 % | contacts |
|---|---:|---:|---:|---:|
{with_doors}

## SLAM and time of a step

`realism="lab"` with `nearest_frontier`: ATE is the mean over the robots.

| floor | seed | ATE without people [m] | with [m] | with over without |
|---|---:|---:|---:|---:|
{slam}

A step of a batch of {batch} episodes takes {steps} (one thread, median of {repeats}).
"""


@dataclass(frozen=True, slots=True)
class Run(Task):
    """An episode: a policy on a floor, with people or without."""

    policy: str
    floor: str
    seed: int
    people: int
    doors: str
    realism: str


@dataclass(frozen=True, slots=True)
class Timing(Task):
    """A batch that is timed."""

    people: int


def measure(run: Run) -> dict[str, Any]:
    """Run an episode; return its figures."""
    policy = make_policy(run.policy)
    settings = make_settings(
        robots=ROBOTS,
        people=run.people,
        doors=float(run.doors),
        realism=run.realism,
        starts="drawn",
        horizon_s=HORIZON_S,
        resolution=0.05,
        camera="xtion_tilted" if "depth" in policy.observes else None,
    )
    history, settings = History(), settings_for(policy, settings)
    env = WatchedExploration(run.floor, settings, watchers=[history] if run.realism == "lab" else [])
    episode = run_episode(policy, env, run.seed)
    data = EpisodeData(env, episode, history if run.realism == "lab" else None)
    about = {name: getattr(run, name) for name in ("policy", "floor", "seed", "people", "doors")}
    return {**about, **figures_of(data, FIGURES)}


def measure_step(timing: Timing) -> dict[str, Any]:
    """Return the median time of a step of a batch without and with people [ms], measured in turns."""
    engines = []
    for people in (0, timing.people):
        settings = make_settings(robots=ROBOTS, people=people, horizon_s=None, stop_coverage=None, starts="drawn")
        engine = Engine(BATCH, list(FLOORS), settings)
        engine.run(None, np.arange(BATCH), list(range(BATCH)))
        engines.append(engine)
    modes, seen = np.full(BATCH, STEPS, np.int8), np.ones(BATCH * ROBOTS, np.bool_)
    commands = np.random.default_rng(0).uniform((0.0, -1.0), (0.5, 1.0), (REPEATS + 1, BATCH * ROBOTS, 2))
    taken = np.zeros((REPEATS + 1, 2))
    for repeat in range(REPEATS + 1):  # the first one warms up
        for k, engine in enumerate(engines):
            begun = time.perf_counter()
            for _ in range(TIMED):
                engine.run_kernel(modes, commands[repeat], seen)
            taken[repeat, k] = (time.perf_counter() - begun) / TIMED * 1e3
    without, among = np.median(taken[1:], axis=0).tolist()
    return {"without_ms": without, "with_ms": among, "over": float(np.median(taken[1:, 1] / taken[1:, 0]))}


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Time a batch, run SLAM, then all policies; every N-th seed, or floor where there is one seed."""
    yield from do_missing(folder / STEPS_FILE, "batches", [Timing(PEOPLE)], measure_step, 1)
    slam = [
        Run("nearest_frontier", floor, seed, people, "0", "lab")
        for seed in SLAM_SEEDS[::every]
        for floor in FLOORS[:2]
        for people in (0, PEOPLE)
    ]
    yield from do_missing(folder / SLAM_FILE, "runs with SLAM", slam, measure, workers)
    runs = [
        Run(policy, floor, seed, people, doors, "ideal")
        for seed in range(0, max(SEEDS.values()), every)
        for policy in POLICIES
        if seed < SEEDS[policy]
        for floor in (FLOORS if SEEDS[policy] > 1 else FLOORS[::every])
        for people, doors in _worlds(policy, seed)
    ]
    yield from do_missing(folder / RUNS_FILE, "runs", runs, measure, workers)


def _worlds(policy: str, seed: int) -> list[tuple[int, str]]:
    """Return numbers of people, and shares of doors, in which a policy runs with a seed."""
    worlds = [(0, "0")] if policy in EXPLORERS and seed < PAIRED else []
    doors = [(PEOPLE, str(DOORS))] if policy in EXPLORERS[:2] and seed < WITH_DOORS else []
    return [*worlds, (PEOPLE, "0"), *doors]


Lines = Sequence[Mapping[str, Any]]
Pair = tuple[Mapping[str, Any], Mapping[str, Any]]


def _pairs(lines: Lines, doors: str = "0", policies: Sequence[str] = POLICIES) -> list[Pair]:
    """Return the runs with people, each after that without on the same floor with the same seed."""
    plain = {(line["policy"], line["floor"], line["seed"]): line for line in lines if not line["people"]}
    among = [line for line in lines if line["people"] and line["doors"] == doors and line["policy"] in policies]
    keys = [(line["policy"], line["floor"], line["seed"]) for line in among]
    return [(plain[key], line) for key, line in zip(keys, among, strict=True) if key in plain]


def _seconds(line: Mapping[str, Any]) -> float:
    return HORIZON_S if line["t99_s"] is None else float(line["t99_s"])


def _ratio(pairs: Sequence[Pair], value: Any = _seconds) -> str:  # noqa: ANN401
    """Return the geometric mean of with over without, with its interval if there are enough pairs."""
    among, without = [value(line) for _, line in pairs], [value(line) for line, _ in pairs]
    if len(pairs) < 2:
        return f"{among[0] / without[0]:.3f}" if pairs else ""
    return f"{paired_ratio(among, without):.3f}"


def _contacts(lines: Lines) -> str:
    """Return the contacts by robots and by people."""
    return ", ".join(str(sum(line[name] for line in lines)) for name in ("contacts_by_robot", "contacts_by_person"))


def _goals(lines: Lines, slam: Lines, steps: Lines) -> str:
    explorers, among = _pairs(lines, policies=EXPLORERS), [line for line in lines if line["people"]]
    caused = float(sum(line["contacts_by_robot"] for line in among))
    found = [
        (f"contacts caused by robots, in {len(among)} runs with people", 0.0, caused, ".0f"),
        ("time to 99 %, with people over without", 1.25, _mean(explorers, _seconds), ".3f"),
        ("ATE of SLAM, with people over without", 1.2, _mean(_pairs(slam), _ate), ".3f"),
        ("time of a step of a batch, with people over without", 1.25, float(steps[0]["over"]), ".3f"),
    ]
    rows = [
        f"| {name} | at most {goal:g} | {value:{shown}} | {'yes' if value <= goal else '**no**'} |"
        for name, goal, value, shown in found
    ]
    iou = _mean(explorers, lambda line: line["iou_occupied"])
    rows.insert(2, f"| IoU of the map, with people over without | at least 0.97 | {iou:.3f} | {_said(iou >= 0.97)} |")
    return "\n".join(rows)


def _said(is_reached: bool) -> str:
    return "yes" if is_reached else "**no**"


def _mean(pairs: Sequence[Pair], value: Any) -> float:  # noqa: ANN401
    return float(np.exp(np.mean([np.log(value(line) / value(plain)) for plain, line in pairs])))


def _ate(line: Mapping[str, Any]) -> float:
    return float(np.mean(line["ate_m"]))


def _policy_row(lines: Lines, policy: str) -> str:
    among, pairs = (
        [line for line in lines if line["policy"] == policy and line["people"]],
        _pairs(lines, "0", (policy,)),
    )
    plain = [line for line in among if line["doors"] == "0"]
    reached = f"{sum(line['t99_s'] is not None for line in plain)} of {len(plain)}"
    ratio = _ratio(pairs) if policy in EXPLORERS else ""
    names = ("near_misses", "time_near_people_s", "yielding_s")
    mean = {name: np.mean([line[name] for line in plain]) for name in names}
    closest = min(line["closest_approach_m"] for line in plain)
    near = f"{mean['near_misses']:.1f} | {mean['time_near_people_s'] / ROBOTS:.1f} | {closest:.3f}"
    lost = f"{mean['yielding_s'] / ROBOTS:.1f}"
    return f"| `{policy}` | {len(plain)} | {len(pairs)} | {ratio} | {reached} | {_contacts(plain)} | {near} | {lost} |"


def _door_row(pairs: Sequence[Pair], policy: str) -> str:
    reached = sum(line["t99_s"] is not None for _, line in pairs)
    contacts = _contacts([line for _, line in pairs])
    return f"| `{policy}` | {len(pairs)} | {_ratio(pairs)} | {reached} | {contacts} |"


def _slam_row(pair: Pair) -> str:
    without, among = (_ate(line) for line in pair)
    return f"| {pair[0]['floor']} | {pair[0]['seed']} | {without:.4f} | {among:.4f} | {among / without:.3f} |"


def page(folder: Path) -> str:
    """Return the results as markdown."""
    lines, slam, steps = (kept_lines(folder / name) for name in (RUNS_FILE, SLAM_FILE, STEPS_FILE))
    known = [policy for policy in POLICIES if any(line["policy"] == policy and line["people"] for line in lines)]
    doors = {policy: _pairs(lines, str(DOORS), (policy,)) for policy in POLICIES}
    return PAGE.format(
        robots=ROBOTS,
        people=PEOPLE,
        floors=len(FLOORS),
        horizon=HORIZON_S,
        doors=100.0 * DOORS,
        goals=_goals(lines, slam, steps),
        policies="\n".join(_policy_row(lines, policy) for policy in known),
        with_doors="\n".join(_door_row(pairs, policy) for policy, pairs in doors.items() if pairs),
        slam="\n".join(_slam_row(pair) for pair in _pairs(slam)),
        batch=BATCH,
        repeats=REPEATS,
        steps=", ".join(f"{line['without_ms']:.2f} ms without people, {line['with_ms']:.2f} ms with" for line in steps),
    )


STUDY = Study(page, work=work, quick=9)
"""The study of people and doors."""
