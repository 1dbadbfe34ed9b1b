"""Tour frontier: robots share out the frontiers of a map, and each drives the first leg of its own tour.

Each frontier is observed from a view of much unknown space, not from next to the corner behind
which it hides. All frontiers are assigned and ordered at once, as tours of the team, planned again when a
robot has seen its goal. Tours are short, the longest one most of all, and show much early. When
nothing of a size is left, robots go to the nearest frontiers, as near as they can come.

References
----------
M. Kulich, J. Faigl and L. Preucil, "On distance utility in the exploration task", 2011: tours past all
frontiers. C. Cao, H. Zhu, H. Choset and J. Zhang, "TARE: a hierarchical framework for efficiently exploring
complex 3D environments", 2021: tours past places from which much is seen. B. Zhou, H. Xu and S. Shen, "RACER:
rapid collaborative exploration with a decentralized multi-UAV system", 2023: tours shared out among robots.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.frontier.frontier import FrontierExplorer
from lidarium.agents.frontier.reach import Choice
from lidarium.agents.intent import Intent
from lidarium.agents.policy import Team
from lidarium.agents.tours.planning import (
    Leg,
    Tourist,
    TourOptions,
    TourRequest,
    TourSettings,
    first_options,
    leg_to,
    memory_of,
    tour_options,
)
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.geometry.rigid import wrapped
from lidarium.mapping.grids.grid_lines import visible
from lidarium.mapping.planning.frontiers.approach import nearest_frontier
from lidarium.mapping.planning.frontiers.frontier_map import FRONTIER, Clusters
from lidarium.mapping.planning.frontiers.views import gain_at
from lidarium.mapping.planning.grid_planning import centres_of
from lidarium.mapping.planning.touring.map_tours import TourMemory
from lidarium.registry import unknown

SIGHT_MARGIN = 0.5
"""Space this far within the edges of a laser's field of view is seen for certain [rad]."""

FRESH_S = 60.0
"""Teammates of which a robot has not heard for this long have no part in its tours [s]."""

TOURS, NEAREST = "tours", "nearest"
"""By what robots are sent: by their tours, or to the nearest frontier."""

ON_THE_SPOT = 0.2
"""A robot that is this near to where a leg ends arrives with the heading that it has [m]."""


class TourFrontier(FrontierExplorer):
    """Explorers that share out all frontiers as tours.

    Robots on one map are planned for together; if the radio is limited, each plans on its own map for
    itself and for the teammates that it has heard of.
    """

    decision_period_s = 0.5

    def __init__(self, shares_map: bool = True, **settings: float) -> None:
        super().__init__(shares_map)
        known = [each.name for each in fields(TourSettings)]
        for name in settings:
            if name not in known:
                raise ValueError(unknown("setting of tours", name, known))
        self.settings = TourSettings(**settings)  # type: ignore[arg-type]
        self._decided_by: Counter[str] = Counter()

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        super().reset(team, seed)
        # Any robot may take any view, so a view counts what the shortest-range lidar of the team would see.
        self.rules = self.settings.rules(min(team.belief(agent).lidar.range_max for agent in team.agents))
        self._legs: dict[Choice, Leg] = {}
        self._intents = {agent: Intent() for agent in team.agents}
        self._memories: dict[NavigationMap, TourMemory] = {}
        self._in_vain: dict[NavigationMap, NDArray[np.bool_]] = {}
        self._sent_by = dict.fromkeys(team.agents, TOURS)
        self._decided_by = Counter()

    @property
    def decided_by(self) -> Mapping[str, int]:
        """How often a robot set out on a tour, or to the nearest frontier when tours had nothing left."""
        return self._decided_by

    def still_stands(self, navigation: NavigationMap, choice: Choice) -> bool:
        """Whether much is left to see from the end of a choice."""
        leg = self._legs.get(choice)
        if leg is None:
            return super().still_stands(navigation, choice)
        if not (navigation.frontiers.flags[leg.cells[:, 0], leg.cells[:, 1]] == FRONTIER).any():
            return False
        gain, _ = gain_at(navigation.log_odds, navigation.resolution, choice.cell, self.rules)
        return gain >= self.settings.kept_share * leg.gain

    def choose(self, agents: list[str], open_agents: list[str]) -> dict[str, Choice | None]:
        """Plan the tours of all robots that explore on one map with an open one."""
        groups = self.groups(agents, open_agents)
        plans = tour_options(
            [self.request(members) for members in groups], self.footprint.radius, self.settings, self.rules
        )
        chosen: dict[str, Choice | None] = {}
        for members, options in zip(groups, plans, strict=True):
            chosen |= self._share_out(members, options)
        return chosen

    def groups(self, agents: list[str], open_agents: list[str]) -> list[list[str]]:
        """Return the robots of each map on which one is open."""
        groups: dict[NavigationMap, list[str]] = {}
        for agent in agents:
            groups.setdefault(self.navigation(agent), []).append(agent)
        return [members for members in groups.values() if any(agent in open_agents for agent in members)]

    def request(self, agents: list[str]) -> TourRequest:
        """Return the map of some robots, its frontiers and who visits them, for a plan."""
        navigation = self.navigation(agents[0])
        if navigation not in self._memories:
            self._memories[navigation] = memory_of(navigation, self.settings)
        least = max(math.ceil(self.settings.minimum_size / navigation.resolution - 1e-9), 1)
        robots = [self._tourist(agent, agent) for agent in agents] + self._others(agents)
        return TourRequest(navigation, self._without_vain(navigation, least), robots, self._memories[navigation])

    def _share_out(self, agents: list[str], options: TourOptions | None) -> dict[str, Choice | None]:
        """Return the goal of each robot on one map."""
        if options is not None:
            self._sent_by |= dict.fromkeys(agents, TOURS)
            wanted = self.pick(agents, options)
            chosen = {
                agent: None if option is None else self.choice_of(agent, option, options)
                for agent, option in zip(agents, wanted, strict=True)
            }
            if any(chosen.values()):
                return chosen
        return {agent: self.current(agent) or self.nearest(agent) for agent in agents}

    def pick(self, agents: list[str], options: TourOptions) -> list[int | None]:
        """Return which option each robot on one map drives to: the first of its tour."""
        return first_options(options)[: len(agents)]

    def choice_of(self, agent: str, option: int, options: TourOptions) -> Choice:
        """Return the choice of a robot that sets out to an option."""
        navigation = self.navigation(agent)
        leg = leg_to(option, options, navigation, self.rules)
        choice = Choice(leg.cell, leg.frontier_cell)
        self._legs[choice] = leg
        self._intents[agent].go_for(np.array(leg.frontier_cell) * navigation.resolution)
        return choice

    def _tourist(self, agent: str, viewer: str) -> Tourist:
        """Return a robot that has a map of its own, as tours see it."""
        belief, intent, current = self.team.belief(agent), self._intents[agent], self.current(agent)
        if current is None:
            intent.settle()
            intent.latest = None
        kept = None if current is None else current.frontier_cell
        return Tourist(_on_map(belief.pose, self.team.belief(viewer)), kept, self.settings.kept * intent.kept)

    def _others(self, agents: list[str]) -> list[Tourist]:
        """Return the teammates that a robot has heard of, and that explore on other maps."""
        belief = self.team.belief(agents[0])
        return [
            Tourist(_on_map(teammate.pose, belief))
            for name, teammate in belief.teammates.items()
            if name not in agents and not teammate.has_ended and teammate.age_s <= FRESH_S
        ]

    def nearest(self, agent: str) -> Choice | None:
        """Return the nearest frontier of any size, to be observed from next to it."""
        navigation, start = self.navigation(agent), self.start_cell(agent)
        if not len(navigation.frontiers):
            return None
        found = nearest_frontier(
            navigation.frontiers,
            navigation.space,
            navigation.log_odds,
            navigation.clearance,
            start,
            self.footprint,
        )
        if found is None:
            return None
        choice = Choice(found.cell, found.frontier_cell)
        self._legs.pop(choice, None)
        self._sent_by[agent] = NEAREST
        return choice

    def _begin(self, agent: str, choice: Choice | None) -> None:
        super()._begin(agent, choice)
        if choice is not None:
            self._decided_by[self._sent_by[agent]] += 1

    def _without_vain(self, navigation: NavigationMap, least: int) -> Clusters:
        """Return the frontiers of at least a number of cells that were not observed in vain."""
        clusters, vain = navigation.frontiers.clusters(minimum_cells=least), self._in_vain.get(navigation)
        return clusters if vain is None else clusters.without(vain, least)

    def _give_up_around(self, agent: str, choice: Choice, reason: str) -> None:
        """Drop the end of a leg from the tours.

        Frontiers that were goals by themselves are given up for good.
        """
        leg = self._legs.get(choice)
        if leg is None:
            super()._give_up_around(agent, choice, reason)
            return
        navigation = self.navigation(agent)
        vain = self._in_vain.setdefault(navigation, np.zeros(navigation.frontiers.flags.shape, np.bool_))
        cells = leg.cells
        if reason == "unseen":
            reach = self.rules.reach / navigation.resolution
            in_sight = visible(navigation.log_odds, choice.cell, cells, reach)
            cells = cells[in_sight] if in_sight.any() else cells
        vain[cells[:, 0], cells[:, 1]] = True

    def _heading(self, agent: str, choice: Choice) -> float:
        """Return the heading at which a robot sees its goal.

        Of these it is the one nearest to the heading of arrival.
        """
        leg = self._legs.get(choice)
        if leg is None:
            return super()._heading(agent, choice)
        belief = self.team.belief(agent)
        position = centres_of(np.asarray(choice.cell), belief.map_origin, self.navigation(agent).resolution)
        run, rise = position - belief.pose[:2]
        arrival = math.atan2(rise, run) if math.hypot(run, rise) > ON_THE_SPOT else float(belief.pose[2])
        room = max(0.5 * belief.lidar.field_of_view - SIGHT_MARGIN, 0.0)
        gap = wrapped(leg.direction - arrival)
        return float(wrapped(leg.direction - math.copysign(min(abs(gap), room), gap)))


def _on_map(pose: NDArray[np.float64], belief: Belief) -> NDArray[np.float64]:
    """Return a pose from the corner of a map's first cell."""
    return np.array([*(pose[:2] - belief.map_origin), pose[2]])
