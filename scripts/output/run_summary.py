"""What ``lidarium run`` prints of an episode."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarium.scripts.common import table

if TYPE_CHECKING:
    from lidarium.evaluation.episodes.runner import Episode

NAMED_GIVEN_UP = 5
"""How many of the frontiers given up are named in the summary.

Result.json has all.
"""

NAMED_JOINS = 10
"""How many joins are listed in the summary."""


def run_summary(
    policy: str, episode: "Episode", result: dict[str, Any], folder: Path, files: list[str]
) -> str:
    """Return the summary of an episode as text."""
    env = episode.env
    area = float(env.score.counted[0]) * env.settings.occupancy.resolution**2
    thresholds = [
        f"{share} % at {result[f't{share}_s']:.1f} s"
        for share in (85, 90, 95, 99)
        if result[f"t{share}_s"] is not None
    ]
    counted = max(int(env.score.counted[0]), 1)
    ended = [
        (agent, reason or "still at work", f"{length:.1f} m", f"{100.0 * seen / counted:.1f} %")
        for (agent, reason), length, seen in zip(
            result["ended_because"].items(), result["path_m"], env.score.seen, strict=True
        )
    ]
    facts = [
        (
            "explored",
            f"{100.0 * result['coverage_final']:.2f} % of {area:.1f} m2 in {result['time_s']:.1f} s of "
            "simulated time",
        ),
        ("reached", ", ".join(thresholds) or "not 85 %"),
        (
            "together",
            f"{sum(result['path_m']):.1f} m driven, overlap {result['overlap']:.2f}, {result['collisions']} "
            "collisions",
        ),
        ("map", f"IoU of occupied cells {result['iou_occupied']:.3f}"),
        ("given up", _given_up(result["given_up"])),
        ("speed", f"{episode.wall_seconds:.1f} s, {result['steps_per_s'] or 0.0:,.0f} steps/s"),
        ("files", f"{folder}: {', '.join(files)}"),
    ]
    how = " (interrupted)" if episode.is_interrupted else ""
    title = f"{result['floor']}: {policy}, seed {result['seed']}, realism {result['realism']}{how}"
    parts = [title, table([*facts, *_of_station(result)])]
    parts += ["", table(ended, ("robot", "ended because", "drove", "saw"))]
    if episode.merges:
        parts += ["", table(_joined(episode), ("joined", "at [s]", "off by [m]", "[deg]"))]
    return "\n".join(parts)


def _of_station(result: dict[str, Any]) -> list[tuple[str, str]]:
    """Return what a station merged and ordered; nothing without one."""
    known, merges = result["supervisor"], result["merges"]
    if known is None:
        return []
    rules = ", ".join(f"{count} by rule {rule}" for rule, count in known["by_rule"].items() if rule != "0")
    pauses = "".join(f", {known[name]} {name}" for name in ("pauses", "resumes") if known[name])
    return [
        (
            "merges",
            f"{known['joined']} joined, {known['dropped']} dropped, {merges['wrong']} wrong by the truth",
        ),
        (
            "orders",
            f"{known['redirections']} redirections{pauses} and {known['stops']} stops of "
            f"{known['decisions']} decisions{f'; {rules}' if rules else ''}",
        ),
    ]


def _joined(episode: "Episode") -> list[tuple[str, ...]]:
    """Return when robots were joined, and how far off by their true starts."""
    from lidarium.evaluation.metrics.merges import transform_error

    rows = []
    for one in episode.merges[:NAMED_JOINS]:
        distance, angle = transform_error(one.found, one.true, one.at)
        rows.append(
            (
                f"{one.a} + {one.b}",
                f"{one.time_s:.1f}",
                f"{distance:.3f}",
                f"{math.degrees(angle):.2f}",
            )
        )
    left = len(episode.merges) - len(rows)
    return [*rows, *([(f"and {left} more",)] if left else [])]


def _given_up(entries: list[dict[str, Any]]) -> str:
    """Name the longest frontiers that were given up, with reason and place."""
    if not entries:
        return "nothing"
    longest = sorted(entries, key=lambda entry: -float(entry["size_m"]))[:NAMED_GIVEN_UP]
    named = ", ".join(
        f"{entry['reason']} at ({entry['x']:.1f}, {entry['y']:.1f}) {entry['size_m']:.2f} m"
        for entry in longest
    )
    more = len(entries) - len(longest)
    return f"{len(entries)} on the way: {named}{f', and {more} shorter' if more else ''}"
