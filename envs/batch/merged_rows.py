"""Merged maps of all episodes of a batch."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.batch.episodes import EpisodeBatch
from lidarium.envs.wrappers.team_exchange import (
    MergeEvent,
    MergingSettings,
    TeamExchange,
    partners,
    team_boxes,
)


class MergedRows:
    """Lets the robots of each episode exchange their maps, as ``MergedMaps`` does for one.

    Parameters
    ----------
    batch : EpisodeBatch
        The episodes.
    merging : MergingSettings
        How.

    Attributes
    ----------
    boxes : dict
        Spaces of what merging adds to an observation.
    arrays : dict of arrays
        What it adds to the observations of all rows, as of the last exchange; new ones after each.
    teams : list of TeamExchange
        Of each episode.

    Raises
    ------
    ValueError
        Where a team is one robot.
    """

    def __init__(self, batch: EpisodeBatch, merging: MergingSettings) -> None:
        self._batch, self._robots = batch, batch.robots
        self.teams = [
            TeamExchange(batch.perception, merging, episode=episode) for episode in range(batch.episodes)
        ]
        self.boxes = team_boxes(batch.robots, batch.settings.map_cells)
        self.arrays: dict[str, NDArray[Any]] = {
            name: np.zeros((batch.rows, *(box.shape or ())), box.dtype) for name, box in self.boxes.items()
        }
        self._events: list[list[MergeEvent]] = [[] for _ in self.teams]

    def exchange(self, seen: NDArray[np.bool_], began: NDArray[np.bool_]) -> None:
        """Exchange maps where it is time, after a run of the batch.

        Parameters
        ----------
        seen : (rows,) bool
            Whose observations are new; the others keep theirs.
        began : (episodes,) bool
            Which episodes have begun.
        """
        self.arrays = {name: array.copy() for name, array in self.arrays.items()}
        seen_robots = seen.reshape(len(self.teams), self._robots)
        for episode, team in enumerate(self.teams):
            if began[episode]:
                team.start()
            robots = np.flatnonzero(seen_robots[episode]).tolist()
            self._events[episode] = team.exchange() if robots else []
            for robot in robots:
                for name, value in team.observed(robot).items():
                    self.arrays[name][episode * self._robots + robot] = value

    def infos(self, infos: dict[str, Any], seen: NDArray[np.bool_]) -> dict[str, Any]:
        """Return infos with who was joined with whom in this step, as ``MergedMaps`` has them."""
        agents = self._batch.settings.agents
        names, events = (np.full(self._batch.rows, None, object) for _ in range(2))
        for row in range(self._batch.rows):
            agent, own = agents[row % self._robots], self._events[row // self._robots]
            names[row] = partners(own, agent)
            events[row] = [event for event in own if agent in (event.a, event.b)]
        truth = {**infos["truth"], "merges": events}
        return {**infos, "truth": truth, "merges": names, "_merges": seen.copy()}
