"""What a station did in an episode, as ``lidarium run`` writes and shows it."""

import json
from collections.abc import Sequence

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


def joined_groups(
    report: PolicyReport, agents: Sequence[str]
) -> tuple[list[set[int]], list[tuple[int, int]]]:
    """Return which robots' maps a station has joined, and by which pairs; robots are places in ``agents``.

    Each robot is in one group; who is joined with nobody is alone in it, as all are without a station.
    """
    groups, pairs = [{robot} for robot in range(len(agents))], list[tuple[int, int]]()
    for join in () if report.supervision is None else report.supervision.joins:
        a, b = agents.index(join.a), agents.index(join.b)
        one, other = (next(group for group in groups if robot in group) for robot in (a, b))
        if join.is_used and one is not other:
            groups = [each for each in groups if each not in (one, other)] + [one | other]
            pairs.append((a, b))
    return groups, pairs
