"""What a station did in an episode, as ``lidarium run`` writes it."""

import json

from lidarium.agents.report import PolicyReport
from lidarium.evaluation.metrics import decision_percentiles


def tick_percentiles(report: PolicyReport) -> dict[str, float | None] | None:
    """Return the entry ``tick_ms`` of ``result.json``; None without a station.

    Percentiles of the wall time of decisions, and of merges between them.
    """
    station = report.supervision
    if station is None:
        return None
    ticks, merges = map(decision_percentiles, (station.tick_seconds, station.merge_seconds))
    return {**ticks, **{f"merge_{name}": value for name, value in merges.items()}}


def decision_lines(report: PolicyReport) -> str:
    """Return the log of a station, a JSON object in each line, by time."""
    entries = () if report.supervision is None else report.supervision.log
    return "".join(json.dumps(entry.as_dict(), allow_nan=False) + "\n" for entry in entries)
