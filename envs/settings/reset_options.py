"""Options of ``reset``."""

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor_choice import Floors
from lidarium.envs.settings.exploration import STARTS, ExplorationSettings
from lidarium.mapping.geometry.bounds import shown


@dataclass(frozen=True, slots=True)
class ResetOptions:
    """Options of ``reset``, checked; None if not given."""

    floor: Floors | None = None
    starts: NDArray[np.float64] | str | None = None
    goal: tuple[float, float] | None = None


Curriculum = Callable[[int], Mapping[str, Any]]
"""Takes the number of an episode, from 0 on, and returns options of ``reset`` for it."""

OPTIONS = tuple(each.name for each in fields(ResetOptions))
"""Names of the options of ``reset``."""

FARTHEST_M = 1e7
"""Maximum coordinate of starts and goals [m], and maximum heading [rad]."""

SIMILARITY = 0.8
"""Minimum similarity of an unknown option's name to a known one for it to count as a typo."""


def check_options(options: Any, known: Iterable[str] = OPTIONS) -> None:  # noqa: ANN401
    """Check that options are a mapping, and that no name is a setting, or a known one misspelt.

    Other unknown names are no error: wrappers and trainers pass options of their own.
    """
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"options of reset are {shown(options)}; want a dict of any of {', '.join(known)}, or None")
    for name, value in (options or {}).items():
        if name in ExplorationSettings.__dataclass_fields__ and name not in known:
            raise ValueError(
                f"{name} is no option of reset, but a setting of the environment; want {name}={shown(value)} "
                "where it is made, or randomize"
            )
        near = difflib.get_close_matches(str(name)[:100], known, n=1, cutoff=SIMILARITY)
        if near and near[0] != name:
            raise ValueError(f"unknown reset option {shown(name)}; did you mean {near[0]!r}?")


def checked_seed(seed: Any) -> int | None:  # noqa: ANN401
    """Return a seed as a number; None stays None."""
    if seed is None:
        return None
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ValueError(f"seed is {shown(seed)}; want a whole number of zero or more, or None")
    return int(seed)


def read_options(options: Mapping[str, Any] | None, robots: int) -> ResetOptions:
    """Check the options that are known and ignore the others."""
    check_options(options)
    if not options:
        return ResetOptions()
    starts = options.get("starts")
    if starts is not None and not (isinstance(starts, str) and starts in STARTS):
        poses = _numbers(starts)
        if poses is None or poses.shape != (robots, 3):
            what = f"is {starts!r}" if poses is None else f"has shape {poses.shape}"
            raise ValueError(
                f"option starts {what}; want ({robots}, 3) numbers up to {FARTHEST_M:g}: x, y [m] and theta [rad] "
                f"of each robot; or one of {', '.join(STARTS)}"
            )
        starts = poses
    goal = options.get("goal")
    if goal is not None:
        place = _numbers(goal)
        if place is None or place.shape != (2,):
            raise ValueError(f"option goal is {goal!r}; want two numbers up to {FARTHEST_M:g}: x, y [m]")
        goal = (float(place[0]), float(place[1]))
    return ResetOptions(options.get("floor"), starts, goal)


def _numbers(value: Any) -> NDArray[np.float64] | None:  # noqa: ANN401
    """Return a value as an array, or None if it is not an array of numbers within the bound."""
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return None
    # Beyond this no coordinate is told from its neighbour, and indices of cells overflow.
    return array if (np.abs(array) <= FARTHEST_M).all() else None


def of_number(curriculum: Curriculum | None, number: int) -> Mapping[str, Any]:
    """Return a curriculum's options for an episode; empty without a curriculum."""
    return {} if curriculum is None else curriculum(number)


def of_curriculum(curriculum: Curriculum | None, number: int, chosen: ResetOptions, robots: int) -> ResetOptions:
    """Return the options of an episode: the chosen ones, and in addition those of a curriculum."""
    if curriculum is None:
        return chosen
    try:
        taught = read_options(curriculum(number), robots)
    except ValueError as error:
        raise ValueError(f"the curriculum of episode {number}: {error}") from error
    given = {name: value for name in OPTIONS if (value := getattr(chosen, name)) is not None}
    return replace(taught, **given)
