"""The handle of an episode's team that policies ask; it never shows the truth."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.engine.engine import Engine
from lidarium.envs.faces.conventions import PLAIN, Conventions
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.radio.messages import DriveState, OperatingState, Order
from lidarium.envs.onboard.station.reports import Report, Station
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.mapping.merging.fusion import FusedMap


class EpisodeTeam:
    """The team of one episode of an engine, by agent.

    Parameters
    ----------
    engine : Engine
        The episodes.
    episode : int, optional
        Which one. The first by default.
    observe : callable, optional
        Returns the observation of a row. Without it `observations` is not there.
    conventions : Conventions, optional
        The form of observations. That of a plain environment by default.
    """

    def __init__(
        self,
        engine: Engine,
        episode: int = 0,
        observe: Callable[[int], Any] | None = None,
        conventions: Conventions = PLAIN,
    ) -> None:
        if not 0 <= episode < engine.episodes:
            raise ValueError(f"episode is {episode}; want a number from 0 to {engine.episodes - 1}")
        self._engine = engine
        self._episode = episode
        self._observe = observe
        self.conventions = conventions
        self._first = episode * engine.robots
        self._index = {agent: robot for robot, agent in enumerate(engine.settings.agents)}

    @property
    def possible_agents(self) -> list[str]:
        """Names of all agents of the team."""
        return list(self._index)

    @property
    def agents(self) -> list[str]:
        """Live agents."""
        return [agent for agent, robot in self._index.items() if self._engine.live[self._first + robot]]

    @property
    def observations(self) -> dict[str, Any]:
        """The last observations of the live agents."""
        observe = self._observe
        if observe is None:
            raise AttributeError("this handle has no observations; want that of vector_env(...).team(episode)")
        return {agent: observe(self.row(agent)) for agent in self.agents}

    @property
    def level(self) -> str:
        """The action level."""
        return self._engine.level_name

    @property
    def settings(self) -> ExplorationSettings:
        """The settings of the team."""
        return self._engine.settings

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return float(self._engine.world.steps[self._episode]) * self._engine.settings.time_step

    def row(self, agent: str) -> int:
        """Return the row of an agent."""
        if agent not in self._index:
            raise ValueError(f"{agent!r} is not among the agents {self.possible_agents}")
        return self._first + self._index[agent]

    def belief(self, agent: str) -> Belief:
        """Return the handle on the belief of an agent's onboard software."""
        return Belief(self._engine.perception, self.row(agent))

    def show_predictions(self) -> None:
        """Let frames, the live view and replays show what the network predicts beyond the team's maps."""
        self._engine.perception.predicts = True

    def drive_state(self, agent: str) -> DriveState:
        """Return the state of an agent's drive to its target."""
        driver, row = self._engine.level.driver, self.row(agent)
        return DriveState.IDLE if driver is None else driver.state(row)

    def operating_state(self, agent: str) -> OperatingState:
        """Return whether an agent takes part in the work, as it knows itself."""
        return self._engine.operating.states[self.row(agent)]

    def last_order(self, agent: str) -> Order | None:
        """Return the last order that an agent took, None if it took no order."""
        return self._engine.operating.orders[self.row(agent)]

    def order(self, agent: str, order: Order) -> None:
        """Send an agent an order from the station; see ``ExplorationEnv.order``."""
        self._engine.operating.order(self.row(agent), order)

    def stop(self, agent: str, reason: str) -> None:
        """End an agent at its next step, with a reason of its policy."""
        row = self.row(agent)
        if not self._engine.live[row]:
            raise ValueError(f"{agent} is not among the live agents {self.agents}")
        self._engine.operating.stopping[row] = reason

    def report(self, agent: str) -> Report | None:
        """Return the last report of an agent that reached the station, None if no report has."""
        robot = self.row(agent) - self._first
        return self._station.report(robot)

    def send_map(self, agent: str, others: FusedMap | None) -> bool:
        """Send an agent the map of others in its map frame; return whether that reached it."""
        robot = self.row(agent) - self._first
        return self._station.send_map(robot, others)

    def forget_walls(self, agent: str, trail: NDArray[np.float64]) -> bool:
        """Let an agent forget the walls along the trail of another; return whether that reached it."""
        robot = self.row(agent) - self._first
        return self._station.forget_walls(robot, trail)

    @property
    def _station(self) -> Station:
        if not self._engine.stations:
            raise ValueError("robots of this batch do not report to a station; make it with reports=True")
        return self._engine.stations[self._episode]
