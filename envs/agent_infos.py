"""What the environment says of its agents beside their observations."""

from collections.abc import Sequence
from typing import Any

from lidarium.envs.onboard.meters import Meters
from lidarium.envs.outcome.scorer import Scorer
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import Simulation
from lidarium.envs.station.operating import Operating


class AgentInfos:
    """Puts together the infos of the agents of one episode.

    Parameters
    ----------
    simulation : Simulation
        Of the one episode.
    settings : ExplorationSettings
        The team.
    scorer : Scorer
        The tally of the episode.
    operating : Operating
        The robots' operating states and orders.
    meters : Meters
        Where the robots' use of energy is reported.
    """

    def __init__(
        self,
        simulation: Simulation,
        settings: ExplorationSettings,
        scorer: Scorer,
        operating: Operating,
        meters: Meters,
    ) -> None:
        self._world, self._score, self._scorer = simulation.world, simulation.score, scorer
        self._operating, self._meters = operating, meters
        self._rows = {agent: row for row, agent in enumerate(settings.agents)}
        self._is_battery_limited = settings.battery.is_limited
        self._camera = settings.camera

    def of(self, agents: Sequence[str]) -> dict[str, dict[str, Any]]:
        """Return what a learner may not see, and the operating states, by agent."""
        rows, coverage, poses, seen = (
            self._rows,
            self._scorer.coverage,
            self._world.poses.copy(),
            self._score.seen.tolist(),
        )
        states, orders, terms = self._operating.states, self._operating.orders, self._scorer.terms
        infos: dict[str, dict[str, Any]] = {}
        for agent in agents:
            row = rows[agent]
            order = orders[row]
            infos[agent] = {
                "truth": {"pose": poses[row], "coverage": coverage, "seen_cells": seen[row]},
                "state": states[row]._value_,
                "order": "" if order is None else order.kind._value_,
                "reward_terms": terms[row],
            }
        if self._is_battery_limited:
            for agent in agents:
                infos[agent]["energy_j"] = float(self._meters.used_j[rows[agent]])
        if self._camera is not None:
            for agent in agents:
                infos[agent]["camera"] = self._camera.calibration
        return infos
