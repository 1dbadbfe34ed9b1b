"""Tables of learned explorers beside classic ones."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lidarium.agents.learned.policy import CORRECTED
from lidarium.agents.tours.policy import NEAREST
from lidarium.agents.tours.policy import TOURS as BY_TOURS
from lidarium.evaluation.statistics import Interval
from lidarium.evaluation.statistics.means import paired_ratio
from lidarium.evaluation.statistics.medians import median_interval

LEARNED, TOURS = "learned", "tour_frontier"
CLASSICS = ("nearest_frontier", "utility_frontier", "explore_lite")
TEAMS = (1, 2, 3)
HORIZON_S = 1800.0

KINDS = {
    "test": "generated floors of the set `test`",
    "kth": "KTH campus floors",
    "lifull": "LIFULL apartments",
    "slam": "maps that robots made of real buildings",
}
"""Kinds of floors."""

Times = dict[str, dict[tuple[str, int], Mapping[str, Any]]]
"""Episodes by policy, floor and size of team."""


def times_table(kind: str, episodes: Times) -> str:
    """Return the table of a kind of floor."""
    about, rows = KINDS[kind], []
    for robots in TEAMS:
        best = best_classic(episodes, robots)
        rows.append(_row(episodes, LEARNED, TOURS, robots))
        rows.append(_row(episodes, TOURS, best, robots) if best else "")
    header = (
        "| robots | policy | over | floors | median | mean | faster | reached 99 % | path |\n"
        "|---:|---|---|---:|---:|---:|---:|---:|---:|"
    )
    lines = "\n".join(row for row in rows if row)
    return f"### {about[0].upper()}{about[1:]}\n\n{header}\n{lines}"


def best_classic(episodes: Times, robots: int) -> str | None:
    """Return the classic explorer that took least time in the mean, None where none ran."""
    means = {
        name: float(np.mean([_time(each) for (_, size), each in episodes[name].items() if size == robots]))
        for name in CLASSICS
        if any(size == robots for _, size in episodes.get(name, {}))
    }
    return min(means, key=lambda name: means[name]) if means else None


def _row(episodes: Times, ours: str, theirs: str, robots: int) -> str:
    """Return a row of the table of times."""
    first, second = episodes.get(ours, {}), episodes.get(theirs, {})
    pairs = sorted(key for key in set(first) & set(second) if key[1] == robots)
    if len(pairs) < 2:
        return ""
    a, b = ([_time(found[key]) for key in pairs] for found in (first, second))
    ratios = np.array(a) / np.array(b)
    median, mean = median_interval(ratios), paired_ratio(a, b)
    longest = [[max(found[key]["path_m"]) for key in pairs] for found in (first, second)]
    paths = paired_ratio(longest[0], longest[1])
    reached = [sum(found[key]["t99_s"] is not None for key in pairs) for found in (first, second)]
    cells = (
        robots,
        f"`{ours}`",
        f"`{theirs}`",
        len(pairs),
        _with_interval(median),
        _with_interval(mean),
        f"{100 * np.mean(ratios < 1.0):.0f} %",
        f"{reached[0]}, {reached[1]}",
        f"{paths.estimate:.3f}",
    )
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def _with_interval(found: Interval) -> str:
    """Return an estimate with its interval, where so few pairs have one."""
    is_bounded = np.isfinite(found.low) and np.isfinite(found.high)
    interval = f"{found.low:.3f} to {found.high:.3f}" if is_bounded else "too few for an interval"
    return f"{found.estimate:.3f} ({interval})"


def senders_table(episodes: Mapping[str, Times]) -> str:
    """Return what sent the robots of the learned explorer, by kind of floor and size of team."""
    rows = [
        "| floors | robots | set out, a run | by tours | by the network, elsewhere | to the nearest frontier "
        "| runs with that |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for kind, found in episodes.items():
        for robots in TEAMS:
            runs = [each for (_, size), each in found.get(LEARNED, {}).items() if size == robots]
            counts = [run["decided_by"] for run in runs if run.get("decided_by")]
            if not counts:
                continue
            sums = [
                sum(count.get(sender, 0) for count in counts) for sender in (BY_TOURS, CORRECTED, NEAREST)
            ]
            shares = " | ".join(f"{100 * each / sum(sums):.1f} %" for each in sums)
            ending = np.mean([NEAREST in count for count in counts])
            often = f"{sum(sums) / len(counts):.1f}"
            rows.append(f"| {KINDS[kind]} | {robots} | {often} | {shares} | {100 * ending:.0f} % |")
    return "\n".join(rows) if len(rows) > 2 else "No run says."


def _time(episode: Mapping[str, Any]) -> float:
    return HORIZON_S if episode["t99_s"] is None else float(episode["t99_s"])


def bounds_table(bounds: Sequence[Mapping[str, Any]], episodes: Times) -> str:
    """Return multiples of the bound by size of team, and what is saved of the time above it."""
    names = [name for name in (*CLASSICS, TOURS, LEARNED) if name in episodes]
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
    training, lines = card["training"], []
    floors = sum(each["floors"] for each in training["rounds"])
    lessons = max((each["samples"] for each in card["fits"].values()), default=0)
    lines.append(
        f"`lidarium train docs/tutorials/learned.toml`: {floors:,} floors of the training set in "
        f"{len(training['rounds'])} rounds, {lessons:,} decisions taught, {card['hours']:.1f} hours with "
        f"{card['workers']} workers, PyTorch {card['versions']['torch']}, seed {training['seed']}. "
        f"Best on the floors of the validation: `{card['best']}`."
    )
    lines.append(
        "| weights | over `tour_frontier`, mean | faster | episodes |\n|---|---:|---:|---:|\n"
        + "\n".join(
            f"| `{name}` | {found['ratio']:.3f} | {100 * found['better']:.0f} % | {found['episodes']} |"
            for name, found in card["validation"].items()
        )
    )
    return "\n\n".join(lines)


def missing_text(kinds: Sequence[str]) -> str:
    """Return which kinds of floors a run lacks, as a paragraph."""
    return f"\nNot in it: {', '.join(KINDS[kind] for kind in kinds)}.\n" if kinds else ""
