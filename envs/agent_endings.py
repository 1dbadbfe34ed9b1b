"""Why the agents of one episode end."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.meters import Meters
from lidarium.envs.outcome.endings import COVERED, HORIZON, REASONS, make_rules, note_endings
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.envs.simulation.simulation import Simulation
from lidarium.envs.station.operating import Operating
from lidarium.mapping.kernels.views import table_of


class AgentEndings:
    """The rules by which the agents of one episode end, and what has ended.

    Parameters
    ----------
    simulation : Simulation
        Of the one episode.
    settings : ExplorationSettings
        The team and the rules.
    meters : Meters
        The robots' battery gauges.
    operating : Operating
        The robots' operating states; ``stopping`` holds the reasons that policies gave.
    """

    def __init__(
        self, simulation: Simulation, settings: ExplorationSettings, meters: Meters, operating: Operating
    ) -> None:
        self._simulation, self._meters, self._operating = simulation, meters, operating
        self._rows = {agent: row for row, agent in enumerate(settings.agents)}
        self._is_battery_limited = settings.battery.is_limited
        self._rules = make_rules(simulation, settings)
        self._rules_table: NDArray[np.int64] | None = None
        self._reasons = np.zeros(settings.robots, np.int8)

    def start(self, goal: tuple[float, float] | None) -> None:
        """Begin an episode: all robots are live."""
        self._rules.live[:], self._rules.is_empty[:] = True, False
        self._rules.goals[0] = np.nan if goal is None else goal

    def count(self) -> int:
        """Note why robots end now, and return how many do."""
        if self._is_battery_limited:
            self._rules.is_empty[:] = self._meters.is_empty
        if self._rules_table is None:
            self._rules_table = table_of(self._rules)
        return int(note_endings(self._simulation.table, len(self._reasons), self._rules_table, self._reasons))

    def due(self, live: Sequence[str]) -> tuple[dict[str, str], bool]:
        """Return why agents end now, and whether the horizon cuts the episode."""
        stopping = self._operating.stopping
        count = self.count()
        if not count and not stopping:
            return {}, False
        endings = {agent: reason for agent, reason in stopping.items() if agent in live}
        is_truncated = False
        for agent in live:
            number = int(self._reasons[self._rows[agent]])
            is_truncated |= number == HORIZON
            if number not in (0, HORIZON):
                endings[agent] = REASONS[number]
        if COVERED not in self._reasons:
            stopping.clear()
        return endings, is_truncated

    def end(self, agent: str, reason: str) -> None:
        """Let a robot stand from now on, in the state that follows from why it ended.

        An empty battery takes its sensors and its radio as well.
        """
        row, world = self._rows[agent], self._simulation.world
        world.moves[row] = 0
        world.flags[row] |= ENDED
        self._rules.live[row] = False
        self._operating.end(row, reason)
        if reason == "battery":
            world.failed[row] = 1

    def __getstate__(self) -> dict[str, Any]:
        # A copy's arrays lie elsewhere.
        return {**self.__dict__, "_rules_table": None}
