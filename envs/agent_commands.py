"""The actions of the agents of one episode, as speeds and turn rates of the robots."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.agent_actions import check_agents, missing_action, numbers_of
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.shares import scale_shares
from lidarium.envs.station.operating import Operating
from lidarium.mapping.geometry.bounds import shown


class AgentCommands:
    """The commands of all robots, in one array that is written at each step.

    Parameters
    ----------
    settings : ExplorationSettings
        The team and its limits.
    operating : Operating
        The robots' operating states and orders: who has an order needs no action.

    Attributes
    ----------
    values : (robots, 2) float64
        Speed and turn rate of each robot [m/s, rad/s].
    """

    def __init__(self, settings: ExplorationSettings, operating: Operating) -> None:
        self._operating = operating
        self._limits = settings.speed_limits.ravel()
        self._rows = {agent: row for row, agent in enumerate(settings.agents)}
        self.values = np.zeros((settings.robots, 2))

    def take(self, agents: Sequence[str], actions: dict[str, Any]) -> NDArray[np.float64]:
        """Return the commands by the actions of the live agents, shares of their limits.

        Raises
        ------
        ValueError
            Where an agent has neither an action nor an order or is unknown, or an action is not two finite
            numbers.
        """
        commands, rows = self.values, self._rows
        check_agents(actions, rows)
        for agent in agents:
            row, action = rows[agent], actions.get(agent)
            if action is None:
                if agent in self._operating.stopping or self._operating.is_addressed(row):
                    commands[row] = 0.0
                    continue
                raise missing_action(agent)
            shares = action if isinstance(action, np.ndarray) else numbers_of(action)
            if shares.shape != (2,) or shares.dtype.kind not in "iuf":
                raise ValueError(
                    f"action of {agent} is {shown(action)}; want two numbers within [-1, 1]: shares of speed "
                    "and turn rate"
                )
            commands[row] = shares
        if not scale_shares(commands, self._limits):
            raise ValueError(
                f"an action is nan or infinite ({actions}); want two finite numbers within [-1, 1] for each "
                "agent"
            )
        return commands
