"""What a suite may hold: types, numbers, how much of it."""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

from lidarium.mapping.geometry.bounds import Rule, above, shown, within

MOST_SUITE_BYTES = 1 << 20
"""Longest file of a suite."""

MOST_EACH = 1_000_000
"""Most policies, floors, teams, seeds or variants."""

MOST_TRIALS = 10_000_000
"""Most episodes of a suite."""

ROBOTS = Rule(int, bounds=within(1, 64))
SEED = Rule(int, bounds=within(0, 2**63 - 1))
SIDE = Rule(float, True, above(0.0, 1000.0))
_POSE = Rule(float, bounds=within(-1e8, 1e8))

Starts = tuple[tuple[float, float, float], ...]


def check_members(name: str, values: Sequence[Any]) -> None:
    """Check that there is something, with names, and nothing is there twice.

    Raises
    ------
    ValueError
        Where it is not so; the message names it.
    """
    if not 1 <= len(values) <= MOST_EACH:
        some = "no" if not values else f"{len(values):,}"
        raise ValueError(f"the suite has {some} {name}; want at least one, at most {MOST_EACH:,}")
    seen: set[Any] = set()
    for value in values:
        if not isinstance(value, Hashable):
            raise ValueError(f"the suite has {shown(value)} among its {name}; want names or numbers")
        if value in seen:
            raise ValueError(f"the suite names {shown(value)} twice among its {name}")
        seen.add(value)


def check_numbers(name: str, values: Iterable[Any], rule: Rule) -> None:
    """Check all numbers of a list of the suite."""
    for value in values:
        if not rule.hold(value):
            raise ValueError(f"{name} of the suite has {shown(value)}; want {rule.wanted}")


def check_texts(name: str, values: Iterable[Any]) -> None:
    """Check that all members of a list of the suite are names."""
    for value in values:
        if not isinstance(value, str):
            raise ValueError(f"{name} of the suite has {shown(value)}; want names")


def check_trials(*lengths: int) -> None:
    """Check that a suite has not more episodes than can be counted one by one."""
    trials = 1
    for length in lengths:
        trials *= max(length, 1)
    if trials > MOST_TRIALS:
        raise ValueError(f"the suite has {trials:,} episodes; want at most {MOST_TRIALS:,}: part it")


def listed(content: Mapping[str, Any], name: str) -> tuple[Any, ...]:
    """Return a list of a suite; a single name or number stands for a list of it."""
    values = content[name]
    if isinstance(values, list | tuple):
        return tuple(values)
    if isinstance(values, str | int):
        return (values,)
    raise ValueError(f"{name} of the suite is {shown(values)}; want a list")


def seeds_of(seeds: Any, content: Mapping[str, Any]) -> tuple[Any, ...]:  # noqa: ANN401
    """Return the seeds of a suite: those of a list, or so many from 0 on."""
    if isinstance(seeds, int) and not isinstance(seeds, bool):
        if not 1 <= seeds <= MOST_EACH:
            raise ValueError(
                f"seeds of the suite is {shown(seeds)}; want a list, or how many, 1 to {MOST_EACH:,}"
            )
        return tuple(range(seeds))
    return listed(content, "seeds")


def tables_of(content: Any, what: str) -> dict[str, dict[str, Any]]:  # noqa: ANN401
    """Return tables by name, as those of variants.

    Raises
    ------
    ValueError
        Where it is anything else.
    """
    if not isinstance(content, Mapping) or not all(isinstance(table, Mapping) for table in content.values()):
        raise ValueError(f"{what} of the suite is {shown(content)}; want tables, as in [{what}.name]")
    return {name: dict(table) for name, table in content.items()}


def starts_of(content: Any) -> dict[str, tuple[Starts, ...]]:  # noqa: ANN401
    """Return teams of starts by floor.

    Raises
    ------
    ValueError
        Where it is no table of lists of teams, each a list of x, y, theta.
    """
    if not isinstance(content, Mapping):
        raise ValueError(f"starts of the suite is {shown(content)}; want a table of teams by floor")
    return {
        floor: tuple(_team(floor, team) for team in _list(floor, teams)) for floor, teams in content.items()
    }


def _team(floor: str, team: Any) -> Starts:  # noqa: ANN401
    for start in _list(floor, team):
        if len(_list(floor, start)) != 3 or not all(_POSE.hold(value) for value in start):
            raise ValueError(
                f"a start on {floor!r} is {shown(start)}; want x, y [m] and theta [rad] of each robot"
            )
    return tuple((start[0], start[1], start[2]) for start in team)


def _list(floor: str, value: Any) -> Sequence[Any]:  # noqa: ANN401
    if not isinstance(value, list | tuple):
        raise ValueError(
            f"starts on {shown(floor)} has {shown(value)}; want a list of teams, each a list of x, y, theta"
        )
    return value
