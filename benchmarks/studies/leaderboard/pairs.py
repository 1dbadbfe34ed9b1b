"""Policies besides each other pair by pair, and how the maps of supervised teams were joined."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from lidarium.benchmarks.studies.shared.study import HORIZON_S, TEAMS
from lidarium.evaluation.statistics.estimates import paired_ratio
from lidarium.evaluation.suites.episodes_file import KEY

PAIRS = (
    ("ideal", "tour_frontier", "explore_lite"),
    ("ideal", "srt", "tour_frontier"),
    ("ideal", "predicted_tours", "tour_frontier"),
    ("ideal", "learned", "tour_frontier"),
    ("ideal", "learned", "srt"),
    ("lab", "tour_frontier", "explore_lite"),
    ("lab", "srt", "tour_frontier"),
    ("lab", "predicted_tours", "tour_frontier"),
    ("lab", "learned", "tour_frontier"),
    ("unknown", "supervised", "independent"),
    ("unknown", "supervised_tours", "supervised"),
    ("unknown", "supervised_predicted", "supervised"),
    ("unknown", "supervised_predicted", "supervised_tours"),
    ("unknown", "supervised_learned", "supervised"),
)
"""World, policy, and which one it is set beside."""

_ROBOTS = " | ".join(f"{robots} robot{'s' * (robots > 1)}" for robots in TEAMS)
HEADER = f"| world | policy | over | floors | {_ROBOTS} | all |\n|---|---|---|---:|{'---:|' * (len(TEAMS) + 1)}"

Episode = Mapping[str, Any]


def pairs_table(
    episodes: Mapping[str, Sequence[Episode]],
    names: Mapping[str, str],
    pairs: Sequence[tuple[str, str, str]] = PAIRS,
) -> str:
    """Return the table of pairs of all teams; empty if there are none."""
    rows = [HEADER]
    for world, ours, theirs in pairs:
        first, second = (_times(episodes.get(world, ()), policy) for policy in (ours, theirs))
        both = sorted(set(first) & set(second))
        if not both:
            continue
        by_team = [[key for key in both if key[1] == robots] for robots in TEAMS]
        cells = [_ratio(first, second, keys) for keys in (*by_team, both)]
        floors = len({floor for floor, _ in both})
        rows.append(f"| {names[world]} | `{ours}` | `{theirs}` | {floors} | {' | '.join(cells)} |")
    return "\n".join(rows) if len(rows) > 1 else ""


Times = Mapping[tuple[str, int], float]


def _ratio(first: Times, second: Times, keys: Sequence[tuple[str, int]]) -> str:
    if len(keys) < 2:
        return "-"
    ours, theirs = ([each[key] for key in keys] for each in (first, second))
    return f"{paired_ratio(ours, theirs, clusters=[floor for floor, _ in keys]):.3f}"


def merges_text(episodes: Iterable[Episode]) -> str:
    """Return how many joins of maps were accepted, and how many of them joined wrong places; empty without episodes."""
    merges = [episode["merges"] for episode in episodes]
    if not merges:
        return ""
    accepted, wrong = (sum(each[name] for each in merges) for name in ("accepted", "wrong"))
    return f" Teams with unknown starts joined maps {accepted:,} times, {wrong:,} of them in a wrong place."


def _times(episodes: Iterable[Episode], policy: str) -> dict[tuple[str, int], float]:
    """Return times to 99 % by floor and team; who did not get there took the whole time."""
    return {
        (episode[KEY].split(" | ")[1], episode["robots"]): (
            HORIZON_S if episode["t99_s"] is None else float(episode["t99_s"])
        )
        for episode in episodes
        if episode["policy"] == policy
    }
