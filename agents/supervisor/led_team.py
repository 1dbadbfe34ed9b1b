"""A team as the policy under a supervisor sees it."""

from collections.abc import Set as AbstractSet

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Team
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.radio.messages import DriveState, OperatingState, Order
from lidarium.envs.onboard.station.reports import Report
from lidarium.mapping.merging.fusion import FusedMap


class LedTeam:
    """A team as the policy under a supervisor sees it.

    Drives for the supervisor are hidden from the policy.
    """

    def __init__(self, team: Team, exploring: AbstractSet[str]) -> None:
        self._team, self._exploring = team, exploring

    @property
    def agents(self) -> list[str]:
        """Live agents."""
        return self._team.agents

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return self._team.time_s

    def belief(self, agent: str) -> Belief:
        """Return what an agent's onboard software knows."""
        return self._team.belief(agent)

    def drive_state(self, agent: str) -> DriveState:
        """Return the state of its driving; idle where it drives for the supervisor."""
        return self._team.drive_state(agent) if agent in self._exploring else DriveState.IDLE

    def operating_state(self, agent: str) -> OperatingState:
        """Return whether it takes part in the work."""
        return self._team.operating_state(agent)

    def report(self, agent: str) -> Report | None:
        """Return what last reached the station."""
        return self._team.report(agent)

    def last_order(self, agent: str) -> Order | None:
        """Return the last order that it took."""
        return self._team.last_order(agent)

    def send_map(self, agent: str, others: FusedMap | None) -> bool:
        """Send it what others know."""
        return self._team.send_map(agent, others)

    def forget_walls(self, agent: str, trail: NDArray[np.float64]) -> bool:
        """Let it forget walls where another robot drove."""
        return self._team.forget_walls(agent, trail)
