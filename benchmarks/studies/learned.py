"""The study ``learned``: learned explorers beside classic ones, on floors that no training has seen."""

import json
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.agents.learned.network import CARD
from lidarium.agents.learned.policy import CORRECTED
from lidarium.agents.predicted.policy import PREDICTED
from lidarium.agents.tours.policy import NEAREST
from lidarium.agents.tours.policy import TOURS as BY_TOURS
from lidarium.benchmarks.results_page import in_file
from lidarium.benchmarks.studies.shared.study import (
    HORIZON_S,
    SETTINGS,
    TEAMS,
    Bounded,
    Progress,
    Study,
    compared_floors,
    do_missing,
    kept_lines,
    measure_bound,
)
from lidarium.envs.floors.catalogue.names import set_floors
from lidarium.evaluation.statistics.estimates import median_interval, paired_ratio
from lidarium.evaluation.suites.campaign import EPISODES_FILE
from lidarium.evaluation.suites.episodes_file import KEY, read_episodes
from lidarium.evaluation.suites.suite import Suite
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT

LEARNED, TOURS, UNPREDICTED = "learned", "tour_frontier", "learned_tours"
CLASSICS = ("nearest_frontier", "utility_frontier", "explore_lite")
UNPREDICTED_WEIGHTS = Path("docs/results/parts/learned_tours.safetensors")
"""Weights of ``learned`` for maps without predictions, in the repository; without them their column is empty."""

KINDS = {
    "test": "generated floors of the set `test`",
    "kth": "KTH campus floors",
    "lifull": "LIFULL apartments",
    "slam": "maps that robots made of real buildings",
}
"""Kinds of floors."""

Times = dict[str, dict[tuple[str, int], Mapping[str, Any]]]
"""Episodes by policy, floor and size of team."""


def means_table(found: Mapping[str, Times]) -> str:
    """Return the mean ratios of times by kind of floor and size of team."""
    rows = [
        f"| floors | robots | number | `{LEARNED}` over `{TOURS}` | without predictions | "
        f"`{TOURS}` over the best classic |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for kind, episodes in found.items():
        for robots in TEAMS:
            pairs = _comparisons(episodes, robots)
            over_tours = {cells[1]: cells for cells in pairs if cells[2] == f"`{TOURS}`"}
            first, unpredicted = (over_tours.get(f"`{name}`") for name in (LEARNED, UNPREDICTED))
            if first:
                classic = next((f"{cells[5]}, {cells[2]}" for cells in pairs if cells[1] == f"`{TOURS}`"), "-")
                without = unpredicted[5] if unpredicted else "-"
                rows.append(f"| {KINDS[kind]} | {robots} | {first[3]} | {first[5]} | {without} | {classic} |")
    return "\n".join(rows)


def times_table(found: Mapping[str, Times]) -> str:
    """Return the table of all comparisons."""
    rows = [
        "| floors | robots | policy | over | number | median | mean | faster | reached 99 % | path |",
        "|---|---:|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for kind, episodes in found.items():
        for robots in TEAMS:
            rows += [f"| {KINDS[kind]} | {' | '.join(cells)} |" for cells in _comparisons(episodes, robots)]
    return in_file("\n".join(rows))


def _comparisons(episodes: Times, robots: int) -> list[tuple[str, ...]]:
    """Return the cells of the learned explorers over tours, and of tours over the best classic one."""
    best = best_classic(episodes, robots)
    pairs = [(LEARNED, TOURS), (UNPREDICTED, TOURS), (LEARNED, UNPREDICTED), *([(TOURS, best)] if best else [])]
    found = [_cells(episodes, ours, theirs, robots) for ours, theirs in pairs]
    return [cells for cells in found if cells]


def best_classic(episodes: Times, robots: int) -> str | None:
    """Return the classic explorer that took least time in the mean, None if none ran."""
    means = {
        name: float(np.mean([_time(each) for (_, size), each in episodes[name].items() if size == robots]))
        for name in CLASSICS
        if any(size == robots for _, size in episodes.get(name, {}))
    }
    return min(means, key=lambda name: means[name]) if means else None


def _cells(episodes: Times, ours: str, theirs: str, robots: int) -> tuple[str, ...]:
    """Return the cells of a comparison, none if there are fewer than two pairs."""
    first, second = episodes.get(ours, {}), episodes.get(theirs, {})
    pairs = sorted(key for key in set(first) & set(second) if key[1] == robots)
    if len(pairs) < 2:
        return ()
    a, b = ([_time(found[key]) for key in pairs] for found in (first, second))
    ratios = np.array(a) / np.array(b)
    median, mean = median_interval(ratios), paired_ratio(a, b)
    longest = [[max(found[key]["path_m"]) for key in pairs] for found in (first, second)]
    paths = paired_ratio(longest[0], longest[1])
    reached = [sum(found[key]["t99_s"] is not None for key in pairs) for found in (first, second)]
    return (
        str(robots),
        f"`{ours}`",
        f"`{theirs}`",
        str(len(pairs)),
        f"{median:.3f}",
        f"{mean:.3f}",
        f"{100 * np.mean(ratios < 1.0):.0f} %",
        f"{reached[0]}, {reached[1]}",
        f"{paths.estimate:.3f}",
    )


def senders_table(episodes: Mapping[str, Times]) -> str:
    """Return what sent the robots of the learned explorer, by kind of floor and size of team."""
    rows = [
        "| floors | robots | departures per run | by tours | by the network | by the prediction "
        "| to the nearest frontier | runs with that |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for kind, found in episodes.items():
        for robots in TEAMS:
            runs = [each for (_, size), each in found.get(LEARNED, {}).items() if size == robots]
            counts = [run["decided_by"] for run in runs if run.get("decided_by")]
            if not counts:
                continue
            sums = [
                sum(count.get(sender, 0) for count in counts) for sender in (BY_TOURS, CORRECTED, PREDICTED, NEAREST)
            ]
            shares = " | ".join(f"{100 * each / sum(sums):.1f} %" for each in sums)
            ending = np.mean([NEAREST in count for count in counts])
            often = f"{sum(sums) / len(counts):.1f}"
            rows.append(f"| {KINDS[kind]} | {robots} | {often} | {shares} | {100 * ending:.0f} % |")
    return in_file("\n".join(rows)) if len(rows) > 2 else "No run says."


def _time(episode: Mapping[str, Any]) -> float:
    return HORIZON_S if episode["t99_s"] is None else float(episode["t99_s"])


def bounds_table(bounds: Sequence[Mapping[str, Any]], episodes: Times) -> str:
    """Return multiples of the bound by size of team, and what is saved of the time above it."""
    names = [name for name in (*CLASSICS, TOURS, UNPREDICTED, LEARNED) if name in episodes]
    rows = [
        "| robots | floors | " + " | ".join(f"`{name}`" for name in names) + " | saved |",
        "|---:|" + "---:|" * (len(names) + 2),
    ]
    for robots in TEAMS:
        known = {
            (line["floor"], robots): line["known_s"]
            for line in bounds
            if line["robots"] == robots and line["known_s"] is not None
        }
        both = [key for key in known if all(key in episodes.get(name, {}) for name in (TOURS, LEARNED))]
        if not both:
            continue
        cells = []
        for name in names:
            multiples = [_time(episodes[name][key]) / known[key] for key in both if key in episodes[name]]
            cells.append(f"{np.median(multiples):.2f}" if multiples else "-")
        tours, ours = (np.array([_time(episodes[name][key]) for key in both]) for name in (TOURS, LEARNED))
        above = tours - np.array([known[key] for key in both])
        saved = f"{100 * (tours - ours).sum() / above.sum():.0f} %"
        rows.append(f"| {robots} | {len(both)} | " + " | ".join(cells) + f" | {saved} |")
    return "\n".join(rows) if len(rows) > 2 else "No floor has a bound in this run."


def card_text(card: Mapping[str, Any]) -> str:
    """Return what the card of the weights says."""
    stages = (("learned_tours", card.get("began_with")), ("learned", card))
    lines = [_training_text(recipe, each) for recipe, each in stages if each]
    lines[-1] += f" Best on the floors of the validation: `{card['best']}`."
    lines.append(
        "| weights | over `tour_frontier`, mean | faster | episodes |\n|---|---:|---:|---:|\n"
        + "\n".join(
            f"| `{name}` | {found['ratio']:.3f} | {100 * found['better']:.0f} % | {found['episodes']} |"
            for name, found in card["validation"].items()
        )
    )
    return "\n\n".join(lines)


def _training_text(recipe: str, card: Mapping[str, Any]) -> str:
    training = card["training"]
    floors = sum(each["floors"] for each in training["rounds"])
    lessons = max((each["samples"] for each in card["fits"].values()), default=0)
    return (
        f"`lidarium train docs/tutorials/{recipe}.toml`: {floors:,} floors of the training set in "
        f"{len(training['rounds'])} rounds, {lessons:,} decisions taught, {card['hours']:.1f} hours with "
        f"{card['workers']} workers, PyTorch {card['versions']['torch']}, seed {training['seed']}."
    )


def missing_text(kinds: Sequence[str]) -> str:
    """Return which kinds of floors a run lacks, as a paragraph."""
    return f"\nNot in it: {', '.join(KINDS[kind] for kind in kinds)}.\n" if kinds else ""


CLASSICS_EVERY, BOUNDS_EVERY = 4, 8
"""Classic explorers run on every so many-th floor of the set; every so many-th has a bound."""

BOUNDS_FILE = "bounds.jsonl"

PAGE = """# Learned explorers

Simulated time to 99 % of `C_free` of `learned`, which corrects [`predicted_tours`](prediction.md), over
`tour_frontier`, and of `tour_frontier` over the best classic explorer, from the same starts. Kobuki, URG-04LX, perfect
poses, no noise, maps of 5 cm; misses count with {horizon:.0f} s. No training saw these floors. `srt`, SLAM and
unknown starts are on the [leaderboard](leaderboard.md).

## The weights

{card}

## Times

Geometric means with 95 % intervals; below 1 is faster. *Without predictions*: the first
[weights](parts/learned_tours.safetensors), which correct `tour_frontier`, over it. Classic explorers ran on every
fourth floor of the set `test`.

{means}

All comparisons, with medians, runs that reached 99 % and the ratio of the longest path of a robot:

{times}
{missing}
## What sends the robots

How often robots of `learned` leave for a target in a run, and what chose it: tours, the network instead of them, costs
on the predicted map alone, or the nearest frontier (if too little is left for a stop of a tour).

{senders}

## Comparison with bounds

Medians of multiples of the time of a team that has the [floor plan](../reference/bounds.md), on {bounded} floors of
the set `test`. *Saved*: share of the time between `tour_frontier` and the bound.

{bounds}

## What limits it

The teacher, which has the floor plan, takes 0.77, 0.85 and 0.87 of the time of tours with one, two and three robots
([decision 22](../decisions/0022-learned-corrections.md)). More or bare floors did not help without predictions: a
training on 2,700 furnished floors gave 0.878, 0.896 and 0.938 on the set `test`, and 1.03, 0.99 and 0.98 on LIFULL.
"""


def suites(data: Path | None, every: int = 1) -> dict[str, Suite]:
    """Return the suites: all floors for tours and learned explorers, then a part of them for classic ones."""
    floors = {"test": list(set_floors("test"))[::every]}
    real = compared_floors(data)
    floors |= {kind: names[::every] for kind, names in real.items() if kind in KINDS and len(names) >= every}
    parts = {kind: names[::CLASSICS_EVERY] if kind == "test" else names for kind, names in floors.items()}
    return {
        **{kind: _suite((TOURS, LEARNED), names) for kind, names in floors.items()},
        **{f"{kind}_classic": _suite(CLASSICS, names) for kind, names in parts.items()},
    }


def _suite(policies: Sequence[str], floors: Sequence[str]) -> Suite:
    settings = {}
    if LEARNED in policies and UNPREDICTED_WEIGHTS.is_file():
        settings[UNPREDICTED] = {"policy": LEARNED, "weights": str(UNPREDICTED_WEIGHTS)}
    return Suite(
        policies=(*policies, *settings),
        floors=tuple(floors),
        robots=TEAMS,
        seeds=(0,),
        variants={DEFAULT_VARIANT: SETTINGS},
        policy_settings=settings,
    )


def work(folder: Path, _data: Path | None, every: int, workers: int) -> Progress:
    """Bound a part of the floors."""
    floors = set_floors("test")[:: BOUNDS_EVERY * every]
    teams = [Bounded(floor, robots, SETTINGS) for floor in floors for robots in TEAMS]
    yield from do_missing(folder / BOUNDS_FILE, "bounds", teams, measure_bound, workers)


def page(folder: Path) -> str:
    """Return the results as markdown."""
    episodes = {kind: _times_in(folder, kind) for kind in KINDS}
    bounds = kept_lines(folder / BOUNDS_FILE) if (folder / BOUNDS_FILE).exists() else []
    return PAGE.format(
        horizon=HORIZON_S,
        card=card_text(json.loads((resources.files("lidarium.agents.learned") / "data" / CARD).read_text())),
        means=means_table(episodes),
        times=times_table(episodes),
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


STUDY = Study(page, suites, work, quick=200)
