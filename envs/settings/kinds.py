"""Teams of robots of different kinds."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from lidarium.envs.settings.robots import ROBOTS, Robot
from lidarium.mapping.geometry.bounds import shown
from lidarium.registry import unknown

LARGEST = ("radius", "height", "length", "width")
SMALLEST = ("cruise_speed", "max_speed", "max_turn_rate", "max_acceleration", "max_turn_acceleration")


def kinds_of(names: Any) -> tuple[str, ...]:  # noqa: ANN401
    """Return names of robots as a tuple, checked.

    Raises
    ------
    ValueError
        Where they are no names, or one is unknown.
    """
    if isinstance(names, str) or not isinstance(names, Iterable):
        raise ValueError(f"kinds is {shown(names)}; want names of robots ({', '.join(ROBOTS)}) in a list")
    chosen = tuple(names)
    for name in chosen:
        if not isinstance(name, str) or name not in ROBOTS:
            raise ValueError(f"kinds has an {unknown('robot', name, ROBOTS)}")
    return chosen


def envelope_of(team: Sequence[Robot]) -> Robot:
    """Return a body with room for all of a team, with the limits of the slowest.

    What is planned for it can be driven by each.
    """
    largest = {name: max(getattr(robot, name) for robot in team) for name in LARGEST}
    smallest = {name: min(getattr(robot, name) for robot in team) for name in SMALLEST}
    return replace(team[0], **largest, **smallest)
