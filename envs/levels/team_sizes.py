"""Observations of teams of which each episode draws the size."""

from typing import Any

import numpy as np
from gymnasium import spaces

from lidarium.mapping.geometry.bounds import shown

OF_TEAMMATES = ("teammates", "messages")
"""Keys of observations with a row for each of the others."""


def largest_team(distribution: Any) -> int:  # noqa: ANN401
    """Return the largest number of robots that is drawn.

    Raises
    ------
    ValueError
        Where it cannot be known, or some draw is no number of robots.
    """
    if isinstance(distribution, tuple | list) and all(_is_size(each) for each in distribution):
        return int(max(distribution))
    raise ValueError(
        f"the distribution of robots is {shown(distribution)}; want (least, most) or a list of whole "
        "numbers of 1 or more, so that the largest team is known"
    )


def _is_size(value: Any) -> bool:  # noqa: ANN401
    return isinstance(value, int) and not isinstance(value, bool) and value >= 1


def fits_into(space: spaces.Space[Any], largest: spaces.Space[Any], key: str = "") -> bool:
    """Whether observations fit those of the largest team but for rows of teammates."""
    if isinstance(space, spaces.Dict) and isinstance(largest, spaces.Dict):
        return space.keys() == largest.keys() and all(
            fits_into(part, largest[name], name) for name, part in space.items()
        )
    if key in OF_TEAMMATES and space.shape is not None and largest.shape is not None:
        return space.shape[0] <= largest.shape[0] and space.shape[1:] == largest.shape[1:]
    return space == largest


def padded(observation: Any, space: spaces.Space[Any]) -> Any:  # noqa: ANN401
    """Return an observation with zeros for the teammates that a team lacks."""
    if isinstance(space, spaces.Dict):
        return {name: padded(observation[name], part) for name, part in space.items()}
    if observation.shape == space.shape:
        return observation
    whole = np.zeros(space.shape or (), space.dtype)
    whole[: len(observation)] = observation
    return whole
