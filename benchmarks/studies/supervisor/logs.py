"""Logs of supervised teams, shortened for the page."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lidarium.evaluation.suites.episodes_file import KEY

LINES_SHOWN = 12
"""Lines of a log on the page."""


def logs_section(logs: Mapping[str, Any]) -> list[str]:
    """Return the logs of typical runs where something was missed."""
    if not logs:
        return []
    parts = [
        "### Typical runs\n\nWhere a figure was missed, what the station noted and ordered: for a size of "
        "teams in the run whose share "
        "of one robot's time is the median, where runs are counted in the middle one of those that missed it."
    ]
    for name, log in logs.items():
        lines = [line for entry in log["lines"] if (line := _line_of(json.loads(entry)))]
        left_out = len(lines) - LINES_SHOWN
        if left_out > 0:
            lines = [*lines[: LINES_SHOWN // 2], f"... {left_out} more", *lines[-LINES_SHOWN // 2 :]]
        parts.append(f"{name}, `{_short(log[KEY])}`:\n\n```\n" + "\n".join(lines) + "\n```")
    return parts


def _line_of(entry: Mapping[str, Any]) -> str:
    """Return what happened at the station, or an order, in a line.

    Nothing of decisions to go on.
    """
    if entry["event"] != "decision":
        return f"{entry['time_s']:6.1f} s  {entry['event']} {' + '.join(entry['agents'])}: {entry['words']}"
    if entry["order"] is None:
        return ""
    inputs = entry["inputs"]
    return (
        f"{entry['time_s']:6.1f} s  rule {entry['rule']}, {entry['agent']} {entry['order']}: {entry['why']} "
        f"(d_rest {inputs['remaining_m'] or 0.0:.2f} m, map_kno {inputs['map_known']:.2f}, d_trav "
        f"{inputs['travelled_m']:.1f} m)"
    )


def _short(key: str) -> str:
    parts = key.split(" | ")
    return " | ".join([Path(parts[1]).name, *parts[2:]])
