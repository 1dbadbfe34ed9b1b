"""Meetings: robots with unreliable radio explore separately, and meet at an agreed position and time.

If all expected robots are in touch, the first of them renews the agreement periodically: the position with the shortest
longest path from all robots, and a time in proportion to the tours past open frontiers. Robots out of touch explore by
their own maps, leave in time for the meeting, and go there early if their map is explored. Robots that have not arrived
after the time of patience are given up, until news of them arrives.

References
----------
Y. Gao et al., "Meeting-Merging-Mission: a multi-robot coordinate framework for large-scale communication-limited
exploration", IROS 2022. D. Tan et al., "IR2: implicit rendezvous for robotic exploration teams under sparse
intermittent connectivity", IROS 2024. C. Cao et al., "M-TARE: representation granularity enables efficient autonomous
exploration", 2023: pursuit.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.frontier.frontier import FrontierExplorer
from lidarium.agents.frontier.policies import NearestFrontier
from lidarium.agents.meetings.agreements import (
    AGREEMENT_BYTES,
    NEWS_BYTES,
    Agreement,
    MeetingSettings,
    News,
    Notebook,
    Place,
    next_meeting_s,
    tour_length,
)
from lidarium.agents.policy import Action, Stop, Team
from lidarium.agents.tours.planning import Tourist
from lidarium.agents.tours.policy import TourFrontier
from lidarium.envs.faces.parallel import Observation
from lidarium.envs.onboard.radio.messages import Target
from lidarium.envs.simulation.disturbances.radio import connects
from lidarium.mapping.planning.grid_planning import Cell, cells_of, centres_of, plan, search

RENEWED_S = 5.0
"""Period at which robots in touch renew their agreement, and plan the path to the meeting again [s]."""

MARGIN_S = 3.0
"""Reserve with which robots leave for a meeting, in addition to the driving time [s]."""

AT_PLACE = 0.7
"""Maximum distance to a position at which a robot has arrived [m]."""

NEW_SHARE = 0.005
"""Minimum share of a robot's known area that a teammate must lack to be worth a meeting."""

MAX_FRONTIERS = 12
"""Maximum number of open frontiers that decide on time and position of a meeting, the largest first."""


class Meetings(FrontierExplorer):
    """Adds meetings to explorers. It has no effect if the radio is ideal or the team is one robot."""

    def meet_by(self, settings: Mapping[str, Any]) -> dict[str, Any]:
        """Take the settings of meetings, and return the other ones."""
        names = {each.name for each in fields(MeetingSettings)}
        self.meetings = MeetingSettings(**{name: value for name, value in settings.items() if name in names})
        return {name: value for name, value in settings.items() if name not in names}

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        super().reset(team, seed)
        settings = team.settings
        self.is_apart = settings.robots > 1 and not settings.radio.is_ideal
        if self.is_apart and not settings.known_starts:
            raise ValueError(
                f"{type(self).__name__} agrees on places, which robots with unknown starts cannot; want "
                "known_starts=True, or the policy 'supervised_tours'"
            )
        touching_m = 2.0 * settings.robot.radius
        if self.is_apart and not connects(settings.radio, touching_m):
            raise ValueError(
                f"{type(self).__name__} needs a radio, but {settings.radio.kind!r} never connects two robots, even "
                f"where they touch, {touching_m:.2f} m apart; want other settings of the radio, or the policy "
                "'tour_frontier'"
            )
        self.notebooks = {agent: Notebook() for agent in team.agents}
        self.told_bytes = 0
        self.agreed: list[Agreement] = []
        self._leaving: dict[str, int] = {}
        self._looked_s = dict.fromkeys(team.agents, -math.inf)
        self._heard_s = team.settings.radio.latency_s + 0.6
        # News take a decision from robot to robot; the exchange of maps a period, and again if messages are lost.
        self._near_s = self._heard_s + 0.5 * settings.robots
        self._share_s = 1.0 + 2.0 * (settings.radio.period_s + settings.radio.latency_s) / (1.0 - settings.radio.loss)

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Send each robot to its frontier or to the meeting, or let it wait."""
        if not self.is_apart:
            return super().act(observations)
        agents = list(observations)
        self._talk(agents)
        bound = [agent for agent in agents if self._has_to_leave(agent)]
        exploring = [agent for agent in agents if agent not in bound]
        for agent in bound:
            self._work[agent].choice = None
        open_agents = self.review(exploring)
        if exploring and (open_agents or self.replans()):
            self.take(self.choose(exploring, open_agents))
        actions: dict[str, Action] = {}
        for agent in agents:
            target = self.target(agent)
            actions[agent] = self._errand(agent) if target is None else target
        if all(action is None for action in actions.values()) and all(self._has_ended(agent) for agent in agents):
            return {agent: Stop(self.reason(agent)) for agent in agents}
        return actions

    # Communication

    def _talk(self, agents: Sequence[str]) -> None:
        """Let robots read the notebooks of teammates with new messages, and renew agreements."""
        now = self.team.time_s
        for agent in agents:
            self.notebooks[agent].news[agent] = self._own_news(agent)
        told = {agent: (dict(book.news), book.agreement) for agent, book in self.notebooks.items()}
        for agent in agents:
            book = self.notebooks[agent]
            for name, teammate in self.team.belief(agent).teammates.items():
                if teammate.age_s <= self._heard_s and name in told:
                    news, agreement = told[name]
                    self.told_bytes += NEWS_BYTES * len(news) + (AGREEMENT_BYTES if agreement else 0)
                    book.read(news, agreement)
            book.note_shared(agent, now - self._near_s, self._share_s)
        for agent in agents:
            self._give_up_missing(agent)
            self._agree(agent)

    def _own_news(self, agent: str) -> News:
        belief, navigation, choice = self.team.belief(agent), self.navigation(agent), self.current(agent)
        place = self._on_floor(agent, belief.pose[:2])
        resolution = navigation.resolution
        goal = place
        if choice is not None:
            goal = self._on_floor(agent, centres_of(np.asarray(choice.cell), belief.map_origin, resolution))
        known = int(np.count_nonzero(navigation.log_odds < 0))
        return News(self.team.time_s, place, goal, known, choice is None and not len(self._open(agent)))

    def _open(self, agent: str) -> NDArray[np.int64]:
        """Return a cell of each frontier in a robot's map, the largest first."""
        navigation = self.navigation(agent)
        least = max(math.ceil(0.3 / navigation.resolution - 1e-9), 1)
        clusters = navigation.frontiers.clusters(minimum_cells=least)
        return clusters.representatives[np.argsort(-clusters.sizes, kind="stable")]

    def near(self, agent: str) -> list[str]:
        """Return the teammates in touch with a robot, directly or through others."""
        return self.notebooks[agent].in_touch(agent, self.team.time_s - self._near_s)

    def _agree(self, agent: str) -> None:
        """Set the next meeting if all expected robots are in touch, and this one is the first of them."""
        book, now = self.notebooks[agent], self.team.time_s
        members = sorted([agent, *self.near(agent)])
        expected = {name for name in book.news if name not in book.given_up}
        if self.meetings.rule != "meeting" or members[0] != agent or not expected <= set(members) or len(members) < 2:
            return
        last = book.agreement
        if last is not None and last.members == tuple(members) and now - self._looked_s[agent] < RENEWED_S:
            return
        self._looked_s[agent] = now
        cells = self._open(agent)[:MAX_FRONTIERS]
        place = self._best_place(agent, members, cells)
        belief = self.team.belief(agent)
        open_at = [
            self._on_floor(agent, each)
            for each in centres_of(cells, belief.map_origin, self.navigation(agent).resolution)
        ]
        speed = belief.robot.cruise_speed
        wait = next_meeting_s(self.meetings, tour_length(place, open_at), len(members), speed)
        number = 1 if last is None else last.number + 1
        book.agreement = Agreement(number, place, now + wait, tuple(members))
        self.agreed.append(book.agreement)

    def _best_place(self, agent: str, members: Sequence[str], cells: NDArray[np.int64]) -> Place:
        """Return the position with the shortest longest path from the robots' goals and the open frontiers."""
        navigation, belief = self.navigation(agent), self.team.belief(agent)
        news = self.notebooks[agent].news
        starts = [self._cell_of(agent, news[name].goal) for name in members] + [
            (int(row), int(column)) for row, column in cells
        ]
        longest: NDArray[np.float64] | None = None
        for start in starts:
            found = search(navigation.space, navigation.log_odds, navigation.clearance, start, self.footprint)
            costs = found.costs()
            if np.isfinite(costs).sum() > 1:
                longest = costs if longest is None else np.maximum(longest, costs)
        if longest is None or not np.isfinite(longest).any():
            return news[agent].place
        # Of nearly equal positions choose one with room for all.
        closeness = navigation.clearance.closeness
        best = longest <= longest.min() + 1.0
        rows, columns = np.nonzero(best)
        k = int(np.lexsort((columns, rows, longest[rows, columns], closeness[rows, columns]))[0])
        cell = np.array([rows[k], columns[k]])
        return self._on_floor(agent, centres_of(cell, belief.map_origin, navigation.resolution))

    def _give_up_missing(self, agent: str) -> None:
        """Give up teammates that have not arrived after the time of patience, those too that never agreed."""
        book, now, near = self.notebooks[agent], self.team.time_s, self.near(agent)
        agreement = book.agreement
        if agreement is None:
            return
        for name, told in book.news.items():
            if name != agent and name not in near and name not in book.given_up:
                way_s = math.dist(told.goal, agreement.place) / self._speed(agent)
                if now > agreement.time_s + self.meetings.patience_s + 0.5 * way_s:
                    book.given_up.add(name)

    # Goals

    def _has_to_leave(self, agent: str) -> bool:
        """Whether a robot has to leave for the meeting now, or is on its way."""
        book, now = self.notebooks[agent], self.team.time_s
        agreement = book.agreement
        if agreement is None or not book.expects(agent, now - self._near_s, -1.0):
            return False
        if self._leaving.get(agent) == agreement.number:
            return True
        direct_s = math.dist(book.news[agent].place, agreement.place) / self._speed(agent)
        if now + 3.0 * direct_s + 2.0 * MARGIN_S + RENEWED_S < agreement.time_s:
            return False
        if now < agreement.time_s and now - self._looked_s[agent] < 1.0:
            return False
        self._looked_s[agent] = now
        way = self._way(agent, agreement.place)
        if now + way / self._speed(agent) + MARGIN_S < agreement.time_s:
            return False
        self._leaving[agent] = agreement.number
        return True

    def _errand(self, agent: str) -> Target | None:
        """Return the target of a robot without frontiers, None to stay."""
        book, now = self.notebooks[agent], self.team.time_s
        missing = book.expects(agent, now - self._near_s, NEW_SHARE)
        agreement = book.agreement
        if not missing:
            return None
        if self.meetings.rule == "meeting" and agreement is not None:
            return self._towards(agent, agreement.place)
        if self.meetings.rule == "pursuit":
            here = book.news[agent].place
            chased = min(missing, key=lambda name: (math.dist(here, book.news[name].goal), name))
            return self._towards(agent, book.news[chased].goal)
        return None

    def _towards(self, agent: str, place: Place) -> Target | None:
        belief = self.team.belief(agent)
        x, y = np.asarray(place) - belief.frame
        if math.dist(belief.pose[:2], (x, y)) <= AT_PLACE:
            return None
        return Target(float(x), float(y))

    def _has_ended(self, agent: str) -> bool:
        """Whether a robot has no frontiers left and no teammates to meet."""
        book = self.notebooks[agent]
        return self.current(agent) is None and not book.expects(agent, self.team.time_s - self._near_s, NEW_SHARE)

    def _way(self, agent: str, place: Place) -> float:
        """Return the length of a robot's path to a position, planned on its own map [m]."""
        navigation = self.navigation(agent)
        found = plan(
            navigation.space,
            navigation.log_odds,
            navigation.clearance,
            self.start_cell(agent),
            self._cell_of(agent, place),
            self.footprint,
        )
        return math.dist(self.notebooks[agent].news[agent].place, place) if found is None else found[0]

    def _speed(self, agent: str) -> float:
        return self.team.belief(agent).robot.cruise_speed

    def _on_floor(self, agent: str, point: NDArray[np.float64]) -> Place:
        x, y = np.asarray(point)[:2] + self.team.belief(agent).frame
        return float(x), float(y)

    def _cell_of(self, agent: str, place: Place) -> Cell:
        belief, navigation = self.team.belief(agent), self.navigation(agent)
        row, column = cells_of(np.asarray(place) - belief.frame, belief.map_origin, navigation.resolution)
        rows, columns = navigation.log_odds.shape
        return min(max(int(row), 0), rows - 1), min(max(int(column), 0), columns - 1)


class MeetingTours(Meetings, TourFrontier):
    """Explorers that divide all frontiers into tours, and meet.

    A robot plans for itself and for teammates out of touch at their last known positions; frontiers nearer to these are
    left to them for ``trust_s``.
    """

    def __init__(self, shares_map: bool = True, **settings: Any) -> None:  # noqa: ANN401
        super().__init__(shares_map, **self.meet_by(settings))

    def _others(self, agents: list[str]) -> list[Tourist]:
        agent = agents[0]
        if not self.is_apart:
            return super()._others(agents)
        book, belief, now = self.notebooks[agent], self.team.belief(agent), self.team.time_s
        corner = belief.frame + belief.map_origin
        return [
            Tourist(np.array([*(np.asarray(told.place) - corner), 0.0]))
            for name, told in book.news.items()
            if name != agent and name not in book.given_up and now - told.time_s <= self.meetings.trust_s
        ]


class MeetingFrontier(Meetings, NearestFrontier):
    """Explorers that drive to the nearest frontier of their own map, and meet."""

    decision_period_s = 0.5

    def __init__(self, minimum_size: float = 0.5, shares_map: bool = True, **settings: Any) -> None:  # noqa: ANN401
        left = self.meet_by(settings)
        if left:
            raise ValueError(f"there is no setting {next(iter(left))!r} of meeting_frontier")
        super().__init__(minimum_size, shares_map)
