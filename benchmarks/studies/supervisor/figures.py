"""Figures of supervised teams.

Runs stand besides those of one robot and of teams that know their starts, on the same floors and seeds.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from lidarium.evaluation.statistics import Interval, median_interval
from lidarium.evaluation.suites.episodes_file import KEY

Row = Mapping[str, Any]
"""A line of ``episodes.jsonl``."""

Pair = tuple[Row, Row]


def floor_of(row: Row) -> str:
    """Return the floor of a run as its suite names it."""
    return str(row[KEY]).split(" | ")[1]


def chosen(
    rows: Iterable[Row],
    policy: str,
    robots: int | None = None,
    is_floor: Callable[[str], bool] = lambda _: True,
    variant: str | None = None,
) -> list[Row]:
    """Return the runs of a policy, in the order of their keys.

    They are of teams of a size, on floors and of a variant of settings; None for all.
    """
    found = [
        row
        for row in rows
        if row["policy"] == policy
        and robots in (None, row["robots"])
        and variant in (None, row["variant"])
        and is_floor(floor_of(row))
    ]
    return sorted(found, key=lambda row: str(row[KEY]))


def partners(rows: Sequence[Row], others: Iterable[Row]) -> list[Pair]:
    """Return each run with the matching one of others.

    It has the same floor, starts, seed and settings; runs without one are left out.
    """
    by_case = {_case(row): row for row in others}
    return [(row, by_case[_case(row)]) for row in rows if _case(row) in by_case]


def with_alone(rows: Sequence[Row], alone: Iterable[Row]) -> list[tuple[Row, list[Row]]]:
    """Return each run with those of one robot from its robots' starts.

    Some of those at least were run; runs without any are left out.

    Drawn starts of a seed begin with that of one robot, so that there is one such run; of the scenarios there
    are all of each start.
    """
    by_start: dict[tuple[str, tuple[float, ...]], list[Row]] = {}
    for row in alone:
        by_start.setdefault((floor_of(row), tuple(row["starts"][0])), []).append(row)
    found = [
        (row, [one for start in row["starts"] for one in by_start.get((floor_of(row), tuple(start)), [])])
        for row in rows
    ]
    return [(row, ones) for row, ones in found if ones]


def time_of(row: Row) -> float:
    """Return when a run reached 99 % [s], inf if it did not."""
    return float("inf") if row["t99_s"] is None else float(row["t99_s"])


def time_shares(rows: Sequence[Row], alone: Iterable[Row]) -> list[float]:
    """Return times to 99 % as shares of one robot's, whose mean counts.

    One robot that was not done by the horizon counts as done then.
    """
    return [
        time_of(row) / float(np.mean([min(time_of(one), one["horizon_s"]) for one in ones]))
        for row, ones in with_alone(rows, alone)
    ]


def path_shares(rows: Sequence[Row], alone: Iterable[Row]) -> list[float]:
    """Return ways of whole teams as shares of one robot's."""
    return [path_of(row) / float(np.mean([path_of(one) for one in ones])) for row, ones in with_alone(rows, alone)]


def time_ratios(rows: Sequence[Row], others: Iterable[Row]) -> list[float]:
    """Return times to 99 % over those of partners. A partner that was not done by the horizon counts as done then."""
    return [time_of(row) / min(time_of(other), float(other["horizon_s"])) for row, other in partners(rows, others)]


def overlap_points(rows: Sequence[Row], others: Iterable[Row]) -> list[float]:
    """Return overlaps at the end less those of partners, in points of percent."""
    return [100.0 * (float(row["overlap"]) - float(other["overlap"])) for row, other in partners(rows, others)]


def path_of(row: Row) -> float:
    """Return the way of all robots of a run [m]."""
    return float(sum(row["path_m"]))


def has_energy(rows: Iterable[Row]) -> bool:
    """Whether runs say what their robots used."""
    return any(row.get("energy_j") is not None for row in rows)


def energy_of(row: Row) -> float:
    """Return what all robots of a run used [kJ], nan if it was not counted."""
    used = row.get("energy_j")
    return float("nan") if used is None else float(sum(used)) / 1e3


def energy_shares(rows: Sequence[Row], alone: Iterable[Row]) -> list[float]:
    """Return what whole teams used as shares of one robot's."""
    return [energy_of(row) / float(np.mean([energy_of(one) for one in ones])) for row, ones in with_alone(rows, alone)]


def median(values: Sequence[float]) -> Interval | None:
    """Return the median with its interval of 95 %, None of nothing."""
    return median_interval(values) if len(values) else None


def has_wrong_merge(row: Row) -> bool:
    """Whether a run used a merge that is wrong where the maps meet."""
    return bool(row["merges"]["wrong"])


def has_off_merge(row: Row) -> bool:
    """Whether a run used a merge that is off against the starts.

    It errs by as much as a wrong one from what the starts say, drift included.
    """
    return bool(row["merges"]["off"])


def has_false_merge(row: Row) -> bool:
    """Whether a run used a merge that is not correct by the stricter tolerance."""
    return bool(row["merges"]["false"])


def _case(row: Row) -> tuple[object, ...]:
    return row["variant"], floor_of(row), row["robots"], row["seed"], str(row["starts"])
