"""Checks of actions that the levels of decision have in common."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.registry import unknown


def check_agents(actions: Any, agents: Collection[str]) -> None:  # noqa: ANN401
    """Check that actions are given by agent, and that there are such agents.

    Those of agents that have ended are no error: trainers go on with them.

    Parameters
    ----------
    actions : mapping
        What a caller gave for ``step``.
    agents : collection of str
        All agents.

    Raises
    ------
    ValueError
        Where these are no actions by agent, or an agent is unknown.
    """
    if not isinstance(actions, Mapping):
        raise ValueError(
            f"actions are a {type(actions).__name__}; want a dict with an action for each agent in "
            "env.agents, such as {agent: env.action_space(agent).sample() for agent in env.agents}"
        )
    for agent in actions:
        if agent not in agents:
            raise ValueError(f"actions have an {unknown('agent', agent, agents)}")


def missing_action(agent: str) -> ValueError:
    """Return the error of a live agent without an action."""
    return ValueError(f"no action for {agent}; step() needs one for every agent in env.agents")


def numbers_of(action: Any) -> NDArray[np.float64]:  # noqa: ANN401
    """Return an action as an array of numbers, an empty one where it is none."""
    try:
        return np.asarray(action, np.float64)
    except (TypeError, ValueError):
        return np.empty(0)


def whole_number(action: Any, most: int) -> int | None:  # noqa: ANN401
    """Return an action of a discrete space as a number from 0 to ``most``, or None where it is none.

    An array of one number, without axes or with one, is taken as that number.
    """
    try:
        array = np.asarray(action)
    except ValueError:  # rows of different lengths
        return None
    if array.shape not in ((), (1,)) or array.dtype.kind not in "iuf":
        return None
    number = float(array.item())
    return int(number) if number.is_integer() and 0 <= number <= most else None
