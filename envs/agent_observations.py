"""The observations of the agents of one episode."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.episode_start import EpisodeStart, goal_of_robots, map_frames
from lidarium.envs.observations import ObservationWriter
from lidarium.envs.observing.observables import ComputedObservations
from lidarium.envs.observing.rows import Rows
from lidarium.envs.onboard.known_poses import KnownPoses
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import Simulation

Observation = dict[str, NDArray[Any]]


class AgentObservations:
    """Writes what the robots of one episode observe, each in its map frame.

    Parameters
    ----------
    simulation : Simulation
        Of the one episode.
    settings : ExplorationSettings
        The team and what it observes.
    has_goal : bool
        Whether the goal is observed.
    poses : KnownPoses
        Where the robots know themselves to be; ``start`` writes its ``offsets``.
    """

    def __init__(
        self, simulation: Simulation, settings: ExplorationSettings, has_goal: bool, poses: KnownPoses
    ) -> None:
        self._settings = settings
        self._rows = {agent: row for row, agent in enumerate(settings.agents)}
        self.offsets = poses.offsets
        self._computed = ComputedObservations(Rows(simulation, settings, poses))
        self._goals = np.full((settings.robots, 2), np.nan)
        self._writer = ObservationWriter(
            simulation, settings, self.offsets, self._goals if has_goal else None
        )

    def start(self, beginning: EpisodeStart) -> None:
        """Begin an episode: take in where the map frames and the goal are."""
        self.offsets[:] = map_frames(beginning, self._settings)
        self._goals[:] = goal_of_robots(beginning, self._settings)

    def of(self, agents: Sequence[str]) -> dict[str, Observation]:
        """Return what each agent observes now."""
        arrays = {**self._writer.write(), **self._computed.buffers()}
        self._computed.write(arrays)
        observations: dict[str, Observation] = {}
        for agent in agents:
            row, observation = self._rows[agent], {}
            for name, array in arrays.items():
                observation[name] = array[row]
            observations[agent] = observation
        return observations
