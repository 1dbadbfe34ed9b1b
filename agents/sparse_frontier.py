"""Sparse frontier: robots explore what their depth cameras have not seen, by their own sparse maps.

A robot chooses a place and a heading from which it sees unknown ground, plans a route there on the graph of
its sparse map, and follows it. It chooses again when most of that ground has been seen. What cannot be seen
from there, or not be reached, is given up by name. A robot without work stays idle and gives way; all stop
together when none has work, each with its reason.

References
----------
B. Yamauchi, "A frontier-based approach for autonomous exploration", 1997; views are chosen as by H. H.
González-Baños and J.-C. Latombe, "Navigation strategies for exploring indoor environments", 2002: what a
place shows against what it costs to come there.
"""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Action, Policy, Stop, Team
from lidarium.agents.report import GivenUp
from lidarium.agents.sparse_views import ViewSettings, apart_from, discs_around, joined
from lidarium.agents.sparse_work import OBSTACLE_M, Work
from lidarium.envs.faces.parallel import Observation
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.radio.messages import DriveState, Route
from lidarium.envs.onboard.sparse_belief import SparseBelief
from lidarium.mapping.sparse.exploring.views import View

KEPT_SHARE = 0.5
"""A robot keeps its choice as long as more of what it wants to see is unknown than this share."""

IGNORED_M = 0.25
"""What is so near to unknown ground that was given up is given up with it [m]."""

LAST_M = 1.0
"""Borders of unknown ground that are as long get a last view from as near as a robot can come [m]."""

TRIALS = 8
"""Views that are tried in one decision."""


class SparseFrontier(Policy):
    """Explorers that see all ground with their depth cameras, and plan on sparse maps.

    Parameters
    ----------
    shares_map : bool
        Whether robots plan on what the whole team has seen, where it reaches them at once, or each on its own
        map.
    **settings
        Any attribute of ``ViewSettings``.
    """

    level = "waypoint"
    observes = ("depth",)

    def __init__(self, shares_map: bool = True, **settings: float) -> None:
        self.shares_map, self.settings = shares_map, ViewSettings(**settings)
        self._given_up: list[GivenUp] = []
        self._work: dict[str, Work] = {}

    def reset(self, team: Team, seed: int) -> None:
        """Begin an episode; nothing is drawn."""
        self.team = team
        self._given_up = []
        self._work = {agent: Work() for agent in team.agents}
        self._sight = self.settings.sight_of(team.belief(team.agents[0]))

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Send every robot to where it sees what is unknown, or to rest where it has nothing to see."""
        agents = list(observations)
        for agent in agents:
            self._review(agent)
        for agent in agents:
            if self._work[agent].view is None:
                self._choose(agent)
        if all(self._work[agent].view is None and not self._work[agent].waits for agent in agents):
            return {agent: Stop(self._reason(agent)) for agent in agents}
        return {agent: self._work[agent].route for agent in agents}

    @property
    def given_up(self) -> list[GivenUp]:
        """What is left unseen by now, and why; what was seen later from elsewhere is not."""
        known = {agent: self._known(agent) for agent in self._work}
        return [
            entry
            for entry in self._given_up
            if known[entry.agent].are_unknown(np.array([[entry.x, entry.y]])).any()
        ]

    def _known(self, agent: str) -> SparseBelief:
        """Return what an agent knows."""
        belief = self.team.belief(agent)
        return belief.shared_sparse_map if self.shares_map else belief.sparse_map

    def _known_for_good(self, agent: str) -> SparseBelief:
        """Return what an agent plans on, with the bodies of teammates that have ended."""
        belief = self.team.belief(agent)
        ended = [each.pose[:2] for each in belief.teammates.values() if each.has_ended]
        return _amid_bodies(self._known(agent), ended, belief)

    def _known_now(self, agent: str) -> SparseBelief:
        """Return what an agent plans on, with what stands in its way for now as well."""
        work, belief = self._work[agent], self.team.belief(agent)
        places = work.obstacles_at(self.team.time_s)
        known = self._known_for_good(agent).amid(places, OBSTACLE_M, belief.robot.height)
        if work.blocked_s == math.inf:
            # Who works moves aside where it stands in the way.
            return known
        return _amid_bodies(known, [each.pose[:2] for each in belief.teammates.values()], belief)

    def _review(self, agent: str) -> None:
        """Drop what an agent has seen, cannot see or cannot reach, and plan its route again where need be."""
        work = self._work[agent]
        if work.view is None:
            return
        belief, state = self.team.belief(agent), self.team.drive_state(agent)
        left = self._known(agent).are_unknown(work.view.points)
        if state is DriveState.ARRIVED:
            points = work.view.points[left]
            # What stood in its way may be gone, as it has seen now.
            is_open = work.is_last and self._known(agent).best_view(belief.pose, points, self._sight)
            if not is_open:
                self._give_up(agent, points, "hidden" if work.is_last else "unseen")
        elif left.mean() > KEPT_SHARE:
            self._keep_going(agent, belief, state)
            return
        work.drop()

    def _keep_going(self, agent: str, belief: Belief, state: DriveState) -> None:
        """See to it that an agent comes to its view: watch its progress, and its route."""
        work, now = self._work[agent], self.team.time_s
        assert work.view is not None
        assert work.route is not None
        work.watch(now, belief.pose, state)
        if work.is_in_vain(now):
            self._give_up(agent, work.view.points, "no_progress")
            work.drop()
            return
        is_stuck = work.is_stuck(now)
        if is_stuck:
            work.take_to_stand(_place_ahead(belief), now)
        is_replanned = (
            is_stuck or state is DriveState.NO_PATH or work.corrections != self._known(agent).corrections
        )
        if state is DriveState.GIVING_WAY or not (
            is_replanned or not self._known_now(agent).is_free(work.route.points)
        ):
            return
        if self._plan(agent, work.view) and not self._is_blocked_for_now(agent, work.view):
            self._give_up(agent, work.view.points, "blocked")
            work.drop()

    def _choose(self, agent: str) -> None:
        """Choose what an agent sees next, and plan its route there."""
        work, belief = self._work[agent], self.team.belief(agent)
        work.blocked_s = math.inf
        known = self._known_now(agent)
        taken = self._taken(agent)
        borders = apart_from(known.unknown_ground(self.settings.minimum_size), taken)
        if not known.has_moved and known.best_view(belief.pose, joined(borders), self._sight) is None:
            # What it sees from where it starts may be too near to lead anywhere: it turns round.
            borders = apart_from([known.unknown_samples()], taken)
        work.waits = False
        for _ in range(TRIALS):
            view, work.is_last = known.best_view(belief.pose, joined(borders), self._sight), False
            if view is None:
                # What has moved may only seem to cut off ground: it is viewed from as near as can be.
                cut_off = [each for each in borders if known.are_cut_off(belief.pose, each).any()]
                longest = max(cut_off, key=len, default=np.empty((0, 2)))
                if len(longest) * known.cell_m < LAST_M:
                    return
                view, work.is_last = known.nearest_view(belief.pose, longest), True
            if not self._plan(agent, view):
                work.begin(view, self.team.time_s, belief.pose)
                return
            if self._is_blocked_for_now(agent, view):
                work.waits = True
            else:
                self._give_up(agent, view.points, "blocked")
            borders = apart_from(borders, discs_around(view.points, IGNORED_M))
        work.waits = True

    def _plan(self, agent: str, view: View) -> str:
        """Plan an agent's route to a view; return why there is none."""
        work, belief = self._work[agent], self.team.belief(agent)
        found = self._known_now(agent).route(belief.pose[:2], view.place)
        if not found.reason:
            work.route = Route(found.points, found.room, view.heading)
            work.corrections, work.blocked_s = self._known(agent).corrections, math.inf
        return found.reason

    def _is_blocked_for_now(self, agent: str, view: View) -> bool:
        """Whether there is a route to a view but for what stands in the way for now."""
        start = self.team.belief(agent).pose[:2]
        return not self._known_for_good(agent).route(start, view.place).reason

    def _taken(self, agent: str) -> NDArray[np.float64]:
        """Return what an agent leaves alone: what it has given up, as discs (N, 3) [m].

        So it does with what teammates that share its map have given up or are about to see, as far as it
        hears of that at once.
        """
        taken = [*self._work[agent].ignored]
        for name, teammate in self.team.belief(agent).teammates.items():
            if name in self._work and teammate.age_s == 0.0 and self.shares_map:
                # Both map frames have the axes of the floor.
                shift = np.append(teammate.pose[:2] - self.team.belief(name).pose[:2], 0.0)
                taken += [disc + shift for disc in (*self._work[name].ignored, *self._work[name].claimed)]
        return np.array(taken).reshape(-1, 3)

    def _give_up(self, agent: str, points: NDArray[np.float64], reason: str) -> None:
        """Ignore unknown ground (N, 2) [m] from now on, and report it."""
        if len(points) == 0:
            return
        self._work[agent].ignored += list(discs_around(points, IGNORED_M))
        cell_m = self._known(agent).cell_m
        middle = points[np.argmin(np.hypot(*(points - points.mean(axis=0)).T))]
        self._given_up.append(
            GivenUp(agent, float(middle[0]), float(middle[1]), len(points) * cell_m, reason)
        )

    def _reason(self, agent: str) -> str:
        """Say why an agent has no work, and name what is left."""
        borders = self._known(agent).unknown_ground(self.settings.minimum_size)
        if not borders:
            return "no_frontier"
        for points in apart_from(borders, self._taken(agent)):
            self._give_up(agent, points, "hidden")
        return "frontier_unreachable"


def _amid_bodies(known: SparseBelief, places: list[NDArray[np.float64]], belief: Belief) -> SparseBelief:
    """Return what is known with the bodies of teammates at places (2,) [m]."""
    return known.amid(np.array(places).reshape(-1, 2), 0.9 * belief.radius, belief.robot.height)


def _place_ahead(belief: Belief) -> NDArray[np.float64]:
    """Return the place (2,) just ahead of a robot's body [m]."""
    x, y, theta = belief.pose.tolist()
    reach = belief.radius + OBSTACLE_M
    return np.array([x + reach * math.cos(theta), y + reach * math.sin(theta)])
