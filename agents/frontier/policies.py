"""The frontier explorers: nearest frontier, greatest team utility, least cost."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.frontier.frontier import FrontierExplorer
from lidarium.agents.frontier.reach import Choice, Reach, reach_of
from lidarium.agents.policy import Team
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.grids.grid_lines import visible
from lidarium.mapping.planning.frontiers.approach import nearest_frontier
from lidarium.mapping.planning.frontiers.frontier_map import Clusters

MAX_UTILITY_LOST = 2.0
"""Largest excess of utility that a path to a frontier may cost.

The excess is over the cheapest frontier; one that costs more is not considered.
"""


FIRST_SLACK = 4.0
"""How far beyond the cheapest frontier others are searched at first [m].

Further where that does not settle the choice.
"""


class NearestFrontier(FrontierExplorer):
    """Explorers that each drive to their cheapest frontier (Yamauchi 1997).

    With a shared map this is Yamauchi 1998.

    Parameters
    ----------
    minimum_size : float, default 0.5
        Frontiers shorter than this are taken only when no longer one is in reach [m].
    shares_map : bool, default True
        Whether robots explore on the team's map.
    """

    def __init__(self, minimum_size: float = 0.5, shares_map: bool = True) -> None:
        super().__init__(shares_map)
        self._minimum_size = minimum_size

    def choose(self, agents: list[str], open_agents: list[str]) -> dict[str, Choice | None]:
        """Choose the nearest frontier for each open agent."""
        return {agent: self._nearest(agent) for agent in open_agents}

    def _nearest(self, agent: str) -> Choice | None:
        navigation, start = self.navigation(agent), self.start_cell(agent)
        for frontiers in (navigation.long_frontiers(self._minimum_size), navigation.frontiers):
            if not len(frontiers):
                continue
            found = nearest_frontier(
                frontiers, navigation.space, navigation.log_odds, navigation.clearance, start, self.footprint
            )
            if found is not None:
                return Choice(found.cell, found.frontier_cell)
        return None


class ExploreLite(FrontierExplorer):
    """Explorers that drive to the frontier of least cost, as in explore_lite.

    The cost is distance less size, as explore_lite weighs them, both in metres.

    Parameters
    ----------
    potential_scale, gain_scale : float, default 3.0, 1.0
        Weights of the distance to the frontier and of its size [1/m].
    minimum_size : float, default 0.75
        Frontiers shorter than this are taken only when no longer one is in reach [m].
    period_s : float, default 3.0
        Time between reconsiderations [s].
    shares_map : bool, default True
        Whether robots explore on the team's map.
    """

    def __init__(
        self,
        potential_scale: float = 3.0,
        gain_scale: float = 1.0,
        minimum_size: float = 0.75,
        period_s: float = 3.0,
        shares_map: bool = True,
    ) -> None:
        super().__init__(shares_map)
        self._potential_scale, self._gain_scale = potential_scale, gain_scale
        self._minimum_size, self._period_s = minimum_size, period_s
        self._last_s = -math.inf

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        super().reset(team, seed)
        self._last_s = -math.inf

    def replans(self) -> bool:
        """Whether the period is over."""
        return self.team.time_s - self._last_s >= self._period_s

    def choose(self, agents: list[str], open_agents: list[str]) -> dict[str, Choice | None]:
        """Choose the frontier of least cost."""
        if self.replans():
            self._last_s = self.team.time_s
            open_agents = agents
        return {agent: self._cheapest(agent) for agent in open_agents}

    def _cheapest(self, agent: str) -> Choice | None:
        navigation = self.navigation(agent)
        clusters = navigation.frontiers.clusters(self.team.belief(agent).map_origin)
        if not len(clusters):
            return None
        # Beyond this no frontier can make up for the way by its size.
        slack = self._gain_scale * float(clusters.sizes.max()) / self._potential_scale + 0.1
        reach = reach_of(clusters, navigation, self.start_cell(agent), self.footprint, self._minimum_size, slack)
        costs = self._potential_scale * reach.costs - self._gain_scale * clusters.sizes
        long_enough = np.where(clusters.sizes >= self._minimum_size, costs, math.inf)
        ranked = long_enough if np.isfinite(long_enough).any() else costs
        best = int(np.argmin(ranked))
        return reach.choices[best] if math.isfinite(ranked[best]) else None


def nearest_frontier_own_map() -> NearestFrontier:
    """Return explorers that each drive to the nearest frontier of their own map."""
    return NearestFrontier(shares_map=False)


class UtilityFrontier(FrontierExplorer):
    """Explorers that share out the team's frontiers by utility less cost.

    The method is that of Burgard, Moors, Stachniss and Schneider (2005).

    Every frontier has utility 1; when a robot takes one, the utility of the others falls with the chance that
    they are seen from there: 1 less their distance over the laser's range, if there is a line of sight.

    Parameters
    ----------
    cost_weight : float, default 0.05
        Utility that a metre of way costs [1/m].
    sensor_range : float, default 5.6
        Range within which a target sees other frontiers [m].
    minimum_size : float, default 0.5
        Frontiers shorter than this are taken only when no longer one is left for a robot [m].
    shares_map : bool, default True
        Whether robots explore on the team's map.
    """

    def __init__(
        self,
        cost_weight: float = 0.05,
        sensor_range: float = 5.6,
        minimum_size: float = 0.5,
        shares_map: bool = True,
    ) -> None:
        super().__init__(shares_map)
        self._cost_weight, self._range, self._minimum_size = cost_weight, sensor_range, minimum_size

    def choose(self, agents: list[str], open_agents: list[str]) -> dict[str, Choice | None]:
        """Assign frontiers to all robots again, best pair first."""
        if not self._are_together(agents):
            return {agent: self._assign([agent])[agent] for agent in open_agents}
        return self._assign(agents)

    def _are_together(self, agents: list[str]) -> bool:
        first = self.navigation(agents[0])
        return all(self.navigation(agent) is first for agent in agents)

    def _assign(self, agents: list[str]) -> dict[str, Choice | None]:
        navigation = self.navigation(agents[0])
        origin = self.team.belief(agents[0]).map_origin
        clusters = navigation.frontiers.clusters(origin)
        chosen: dict[str, Choice | None] = dict.fromkeys(agents)
        if not len(clusters):
            return chosen
        most = MAX_UTILITY_LOST / self._cost_weight
        slacks = dict.fromkeys(agents, min(FIRST_SLACK, most))
        reaches: dict[str, Reach] = {}
        unsure = list(agents)
        while unsure:
            for agent in unsure:
                start = self.start_cell(agent)
                reach = reach_of(clusters, navigation, start, self.footprint, self._minimum_size, slacks[agent])
                reaches[agent] = replace(reach, beyond=math.inf) if slacks[agent] >= most else reach
                slacks[agent] = min(2.0 * slacks[agent], most)
            chosen, unsure = self._share_out(agents, reaches, clusters, navigation)
        return chosen

    def _share_out(
        self, agents: list[str], reaches: Mapping[str, Reach], clusters: Clusters, navigation: NavigationMap
    ) -> tuple[dict[str, Choice | None], list[str]]:
        """Share out the frontiers, and name the agents that are unsure.

        These are agents that might do better with a frontier beyond their reach.
        """
        utility = np.where(clusters.sizes >= self._minimum_size, 1.0, 0.25)
        chosen: dict[str, Choice | None] = dict.fromkeys(agents)
        waiting = list(agents)
        while waiting:
            values = {agent: utility - self._cost_weight * reaches[agent].costs for agent in waiting}
            agent = max(waiting, key=lambda name: (float(values[name].max()), -waiting.index(name)))
            best = int(np.argmax(values[agent]))
            value = float(values[agent][best])
            unsure = [name for name in waiting if reaches[name].may_hold(utility, self._cost_weight, value)]
            if unsure:
                return chosen, unsure
            waiting.remove(agent)
            if not math.isfinite(value):
                continue
            choice = reaches[agent].choices[best]
            chosen[agent] = choice
            if choice is not None:
                utility = utility - self._seen_share(clusters, clusters.representatives[best], navigation)
                utility[best] = min(utility[best], -1.0)
        return chosen, []

    def _seen_share(
        self, clusters: Clusters, target: NDArray[np.int64], navigation: NavigationMap
    ) -> NDArray[np.float64]:
        """Return by how much each cluster's utility falls when a robot goes to a target."""
        cells = clusters.representatives
        position = (int(target[0]), int(target[1]))
        seen = visible(navigation.log_odds, position, cells, self._range / navigation.resolution)
        distances = np.hypot(*(cells - target).T) * navigation.resolution
        return np.where(seen, np.clip(1.0 - distances / self._range, 0.0, 1.0), 0.0)
