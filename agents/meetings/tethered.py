"""Tethered explorers: a team that always stays within radio range, the opposite of meetings.

The first robot in touch plans for all. A robot drives to a goal only if, by the model of the radio on the known map,
all robots are connected when they are at their goals; if no such goal exists, all drive to one together. A robot that
loses touch returns to the last known position of the others, which wait for it for the time of patience.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from lidarium.agents.frontier.reach import Choice
from lidarium.agents.meetings.policy import Meetings
from lidarium.agents.tours.planning import TourOptions
from lidarium.agents.tours.policy import TourFrontier
from lidarium.envs.floors.floor import Raster
from lidarium.envs.onboard.radio.messages import Target
from lidarium.envs.settings.radio import RadioSettings
from lidarium.envs.simulation.disturbances.radio import links
from lidarium.mapping.planning.grid_planning import cells_of

MARGIN_DB, MARGIN = 3.0, 0.9
"""Reserve of a reliable link: signal above the threshold [dB], and maximum share of the range."""


def careful(radio: RadioSettings) -> RadioSettings:
    """Return the settings of a radio with that reserve, by which reliable links are found."""
    return replace(radio, threshold=radio.threshold + MARGIN_DB, reach=MARGIN * radio.reach)


class Tethered(Meetings, TourFrontier):
    """Explorers by tours that stay in touch, directly or through others."""

    def __init__(self, shares_map: bool = True, **settings: Any) -> None:  # noqa: ANN401
        super().__init__(shares_map, **self.meet_by(settings))

    def groups(self, agents: list[str], open_agents: list[str]) -> list[list[str]]:
        """Return the groups of robots in touch that contain an open one."""
        if not self.is_apart:
            return super().groups(agents, open_agents)
        left, groups = list(agents), []
        while left:
            first = left[0]
            near = {first, *self.near(first)}
            groups.append([agent for agent in left if agent in near])
            left = [agent for agent in left if agent not in near]
        return [members for members in groups if any(agent in open_agents for agent in members)]

    def pick(self, agents: list[str], options: TourOptions) -> list[int | None]:
        """Return the option of each robot in touch, chosen so that all stay connected."""
        wanted = super().pick(agents, options)
        if not self.is_apart or len(agents) == 1:
            return wanted
        navigation = self.navigation(agents[0])
        cells = [self._goal_cell(agent) for agent in agents]
        # Unknown cells may be walls.
        raster = Raster((navigation.log_odds >= 0).astype(np.uint8), (0.0, 0.0), navigation.resolution)
        places = (np.vstack([np.array(cells), options.cells])[:, ::-1] + 0.5) * navigation.resolution
        joined = links(careful(self.team.settings.radio), places, raster)
        at = list(range(len(agents)))
        chosen: list[int | None] = [None] * len(agents)
        for robot in range(len(agents)):
            reached = np.flatnonzero(options.is_reached[robot])
            order = reached[np.argsort(options.first[robot, reached], kind="stable")].tolist()
            first = wanted[robot]
            for option in order if first is None else [first, *order]:
                moved = [*at[:robot], len(agents) + option, *at[robot + 1 :]]
                if option not in chosen and _is_joined(joined, moved):
                    at, chosen[robot] = moved, option
                    break
        if any(option is not None for option in chosen):
            return chosen
        together = next((option for option in wanted if option is not None), None)
        return [
            together if together is not None and options.is_reached[k, together] else None for k in range(len(agents))
        ]

    def nearest(self, agent: str) -> Choice | None:
        """Return the nearest frontier of the first robot in touch, to which all drive together."""
        if not self.is_apart:
            return super().nearest(agent)
        first = min([agent, *self.near(agent)])
        return super().nearest(first if first in self.notebooks and first in self.team.agents else agent)

    def _goal_cell(self, agent: str) -> tuple[int, int]:
        current = self.current(agent)
        if current is not None:
            return current.cell
        belief = self.team.belief(agent)
        row, column = cells_of(belief.pose[:2], belief.map_origin, self.navigation(agent).resolution)
        return int(row), int(column)

    def _agree(self, agent: str) -> None:
        """Do nothing: robots that stay together need no meetings."""

    def _give_up_missing(self, agent: str) -> None:
        book, now = self.notebooks[agent], self.team.time_s
        for name, told in book.news.items():
            if name != agent and now - told.time_s > self._near_s + self.meetings.patience_s:
                book.given_up.add(name)

    def _has_to_leave(self, agent: str) -> bool:
        return bool(self._lost(agent))

    def _errand(self, agent: str) -> Target | None:
        book, lost = self.notebooks[agent], self._lost(agent)
        if not lost:
            return None
        # If the team is split, the part without the first robot returns to the other part.
        here = min([agent, *self.near(agent)])
        if here < min(lost):
            return None
        nearest = min(lost, key=lambda name: (math.dist(book.news[agent].place, book.news[name].place), name))
        return self._towards(agent, book.news[nearest].place)

    def _lost(self, agent: str) -> list[str]:
        """Return the expected teammates out of touch."""
        book, near = self.notebooks[agent], self.near(agent)
        return [name for name in book.news if name not in (agent, *near, *book.given_up)]


def _is_joined(joined: NDArray[np.bool_], at: list[int]) -> bool:
    """Return whether robots at these positions are connected; two at the same position are."""
    table = joined[np.ix_(at, at)] | np.equal.outer(at, at)
    return int(connected_components(table, directed=False)[0]) == 1
