"""Which recorded episodes of a directory a film shows.

They have one floor and seed; of each policy there is one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lidarium.evaluation.analysis.episodes import Row, pair_key_of, read_episodes, variant_of
from lidarium.evaluation.analysis.records import FOLDER, read_records, record_key
from lidarium.evaluation.drawing.track_film import MOST_SIDE_BY_SIDE
from lidarium.evaluation.suites.trial import DEFAULT_VARIANT


@dataclass(frozen=True, slots=True)
class Wanted:
    """The conditions on the episodes of a film; None is any.

    Attributes
    ----------
    floor : str or None
        Name of the floor.
    robots, seed : int or None
        Size of the team, and seed.
    policies : sequence of str
        The policies, in this order; all by default.
    """

    floor: str | None = None
    robots: int | None = None
    seed: int | None = None
    policies: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class Chosen:
    """Episodes of a film.

    Attributes
    ----------
    title : str
        Title of the film.
    records : dict
        File of the record of each policy.
    left_out : list of str
        Policies for which there is no room.
    """

    title: str
    records: dict[str, Path]
    left_out: list[str]


def choose_episodes(directory: Path, wanted: Wanted) -> Chosen:
    """Return the episodes of a film.

    They have the same floor, starts, seed, team and settings. Of all that are wanted those with the most policies
    are chosen, and of these the first in the directory.
    """
    rows = read_episodes(directory).rows
    records, warnings = read_records(directory, rows)
    recorded = [row for row in rows if record_key(row) in records]
    if not recorded:
        why = warnings[0] if warnings else f"there are no records in {Path(directory) / FOLDER}"
        raise ValueError(
            f"no episode of {directory} can be filmed: {why}; want a folder that `lidarium evaluate` wrote "
            "without --no-records"
        )
    groups: dict[Any, dict[str, Row]] = {}
    for row in _matching(recorded, wanted):
        groups.setdefault(pair_key_of(row), {}).setdefault(str(row["policy"]), row)
    group = max(groups.values(), key=len)
    shown = list(wanted.policies) or sorted(group)
    if missing := [name for name in shown if name not in group]:
        raise ValueError(
            f"--film-policies has {missing[0]!r}, which has no recorded episode from the same start as "
            f"{', '.join(sorted(group))}; want policies that explored a floor from the same start and seed"
        )
    return Chosen(
        _title_of(next(iter(group.values()))),
        {name: records[record_key(group[name])].path for name in shown[:MOST_SIDE_BY_SIDE]},
        shown[MOST_SIDE_BY_SIDE:],
    )


def _matching(rows: list[Row], wanted: Wanted) -> list[Row]:
    """Return the episodes that are wanted."""
    for key, value in (("floor", wanted.floor), ("robots", wanted.robots), ("seed", wanted.seed)):
        found = {row[key]: None for row in rows}
        if value is not None and value not in found:
            raise ValueError(_none_left(key, value, list(found)))
        rows = [row for row in rows if value is None or row[key] == value]
    for policy in wanted.policies:
        found = {row["policy"]: None for row in rows}
        if policy not in found:
            raise ValueError(_none_left("policies", policy, list(found)))
    return [row for row in rows if not wanted.policies or row["policy"] in wanted.policies]


def _none_left(key: str, value: Any, found: list[Any]) -> str:  # noqa: ANN401
    listed = ", ".join(map(str, found[:20])) + (", ..." if len(found) > 20 else "")
    return f"--film-{key} is {value!r}, of which no episode is recorded; want one of {listed}"


def _title_of(row: Row) -> str:
    robots = "1 robot" if row["robots"] == 1 else f"{row['robots']} robots"
    variant = "" if variant_of(row) == DEFAULT_VARIANT else variant_of(row)
    return ", ".join(part for part in (str(row["floor"]), robots, f"seed {row['seed']}", variant) if part)
