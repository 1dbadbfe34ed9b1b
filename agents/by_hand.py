"""A robot that a person drives, among robots of a policy."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lidarium.agents.policy import Action, Policy, Team
from lidarium.envs.faces.parallel import Observation


class ByHand(Policy):
    """Lets a person drive one robot of a team; a policy drives the others, or they stand still.

    Parameters
    ----------
    hand : callable
        Returns the action of the person's robot for this step: two shares of speed and turn rate, a ``Target``, or
        ``Stop``.
    others : Policy, optional
        Decides for the other robots, by velocities or waypoints. They stand still by default.
    agent : str, optional
        The person's robot, ``robot_0`` by default.

    Raises
    ------
    ValueError
        By ``reset``, if there is no such robot, or ``others`` decides at another level.
    """

    level = "velocity"

    def __init__(self, hand: Callable[[], Action], others: Policy | None = None, agent: str = "robot_0") -> None:
        self._hand, self._others, self._agent = hand, others, agent
        if others is not None:
            self.shares_map, self.observes = others.shares_map, others.observes

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        if self._agent not in team.agents:
            raise ValueError(f"there is no {self._agent!r} to drive by hand; want one of {', '.join(team.agents)}")
        if self._others is not None and len(team.agents) > 1:
            self._others.reset(team, seed)

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Return the person's action for their robot, and the policy's actions for the others."""
        others: list[Any] = [agent for agent in observations if agent != self._agent]
        actions: dict[str, Action] = dict.fromkeys(others, np.zeros(2, np.float32))
        if self._others is not None and others:
            actions = self._others.act(observations, others)
        if self._agent in observations:
            actions[self._agent] = self._hand()
        return actions
