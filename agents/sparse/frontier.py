"""Sparse frontier: robots explore space unseen by their depth cameras, by their own sparse maps.

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
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Action, Policy, Stop, Team
from lidarium.agents.report import GivenUp
from lidarium.agents.sparse.views import ViewSettings, apart_from, discs_around, joined
from lidarium.envs.faces.parallel import Observation
from lidarium.envs.onboard.belief import Belief
from lidarium.envs.onboard.radio.messages import DriveState, Route
from lidarium.envs.onboard.sparse_belief import SparseBelief
from lidarium.mapping.sparse.exploring.views import View

PATIENCE_S = 20.0
"""Time without motion after which a robot gives up what it wants to see [s]."""

STUCK_S, BLOCKED_S = 10.0, 3.0
"""Time without motion, or of a blocked path, after which something unknown is taken to stand there [s]."""

MOVED_M, TURNED = 0.1, 0.2
"""Minimum motion that counts [m, rad]."""

CLAIMED_M = 1.0
"""Space this near to a robot's next view is left to it [m]."""

OBSTACLE_S, OBSTACLE_M = 30.0, 0.1
"""How long, and how far to each side, something unknown is taken to stand there [s, m]."""


@dataclass(slots=True)
class _Work:
    """State of a robot.

    Attributes
    ----------
    view, route : View, Route or None
        The discs that it is about to see, and its route.
    is_last : bool
        Whether it only comes as near as it can, if it cannot come to see.
    corrections : int
        How often its past had been corrected when the route was planned.
    moved_s, pose : float, (3,) float64
        Time and pose of its last motion [s, m, rad].
    blocked_s : float
        Since when its path is blocked [s]; inf if it is not.
    waits : bool
        Whether something to see is out of reach only for now, or more is still to be tried.
    ignored : list of (3,) float64
        Unknown ground that it has given up: x, y and radius of discs [m].
    obstacles : list of (float, (2,) float64)
        Positions of assumed obstacles, and when each expires [s, m].
    """

    view: View | None = None
    route: Route | None = None
    is_last: bool = False
    corrections: int = 0
    moved_s: float = 0.0
    pose: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    blocked_s: float = math.inf
    waits: bool = False
    ignored: list[NDArray[np.float64]] = field(default_factory=list)
    obstacles: list[tuple[float, NDArray[np.float64]]] = field(default_factory=list)

    @property
    def claimed(self) -> NDArray[np.float64]:
        """The discs (N, 3) that it is about to see [m]."""
        return np.empty((0, 3)) if self.view is None else discs_around(self.view.points, CLAIMED_M)

    def begin(self, view: View, now: float, pose: NDArray[np.float64]) -> None:
        """Begin with a view, at a time [s] and x, y, theta (3,) [m, rad]."""
        self.view, self.moved_s, self.pose = view, now, pose

    def drop(self) -> None:
        """Leave the view alone."""
        self.view = self.route = None

    def watch(self, now: float, pose: NDArray[np.float64], state: DriveState) -> None:
        """Take in the robot's pose and the state of its driving."""
        turned = abs(math.remainder(float(pose[2] - self.pose[2]), 2.0 * math.pi))
        has_moved = math.dist(pose[:2], self.pose[:2]) > MOVED_M or turned > TURNED
        if has_moved or state is DriveState.GIVING_WAY:
            self.moved_s, self.pose = now, pose
        self.blocked_s = min(self.blocked_s, now) if state is DriveState.BLOCKED else math.inf

    def is_in_vain(self, now: float) -> bool:
        """Whether the robot has not moved for too long."""
        return now - self.moved_s > PATIENCE_S

    def is_stuck(self, now: float) -> bool:
        """Whether something unknown must block the way."""
        return now - min(self.blocked_s, now) > BLOCKED_S or now - self.moved_s > STUCK_S

    def take_to_stand(self, place: NDArray[np.float64], now: float) -> None:
        """Assume an obstacle at a position (2,) [m] for a while."""
        self.obstacles.append((now + OBSTACLE_S, place))
        self.blocked_s = math.inf

    def obstacles_at(self, now: float) -> NDArray[np.float64]:
        """Return the positions of assumed obstacles, (N, 2) [m]."""
        self.obstacles = [entry for entry in self.obstacles if entry[0] > now]
        return np.array([position for _, position in self.obstacles]).reshape(-1, 2)


KEPT_SHARE = 0.5
"""A robot keeps its choice as long as more of what it wants to see is unknown than this share."""

IGNORED_M = 0.25
"""Space this near to unknown ground that was given up is given up with it [m]."""

LAST_M = 1.0
"""Borders of unknown ground that are as long get a last view from as near as a robot can come [m]."""

TRIALS = 8
"""Views that are tried in one decision."""


class SparseFrontier(Policy):
    """Explorers that see all ground with their depth cameras, and plan on sparse maps.

    Parameters
    ----------
    shares_map : bool, default True
        Whether robots plan on the team's map, if it reaches them at once, or each on its own
        map.
    **settings
        Any attribute of ``ViewSettings``.
    """

    level = "waypoint"
    observes = ("depth",)

    def __init__(self, shares_map: bool = True, **settings: float) -> None:
        self.shares_map, self.settings = shares_map, ViewSettings(**settings)
        self._given_up: list[GivenUp] = []
        self._work: dict[str, _Work] = {}

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode; nothing is drawn."""
        self.team = team
        self._given_up = []
        self._work = {agent: _Work() for agent in team.agents}
        self._sight = self.settings.sight_of(team.belief(team.agents[0]))

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Send every robot to a view of unknown space, or to rest if there is none."""
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
        """The areas left unseen so far, with reasons, without those seen later from elsewhere."""
        known = {agent: self._known(agent) for agent in self._work}
        return [
            entry for entry in self._given_up if known[entry.agent].are_unknown(np.array([[entry.x, entry.y]])).any()
        ]

    def _known(self, agent: str) -> SparseBelief:
        """Return the map of an agent."""
        belief = self.team.belief(agent)
        return belief.shared_sparse_map if self.shares_map else belief.sparse_map

    def _known_for_good(self, agent: str) -> SparseBelief:
        """Return the map that an agent plans on, with the bodies of teammates that have ended."""
        belief = self.team.belief(agent)
        ended = [each.pose[:2] for each in belief.teammates.values() if each.has_ended]
        return _amid_bodies(self._known(agent), ended, belief)

    def _known_now(self, agent: str) -> SparseBelief:
        """Return the map that an agent plans on, with the obstacles assumed for now as well."""
        work, belief = self._work[agent], self.team.belief(agent)
        positions = work.obstacles_at(self.team.time_s)
        known = self._known_for_good(agent).amid(positions, OBSTACLE_M, belief.robot.height)
        if work.blocked_s == math.inf:
            # Who works moves aside where it stands in the way.
            return known
        return _amid_bodies(known, [each.pose[:2] for each in belief.teammates.values()], belief)

    def _review(self, agent: str) -> None:
        """Drop views that an agent has seen, cannot see or cannot reach, and replan its route if needed."""
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
        is_replanned = is_stuck or state is DriveState.NO_PATH or work.corrections != self._known(agent).corrections
        if state is DriveState.GIVING_WAY or not (
            is_replanned or not self._known_now(agent).is_free(work.route.points)
        ):
            return
        if self._plan(agent, work.view) and not self._is_blocked_for_now(agent, work.view):
            self._give_up(agent, work.view.points, "blocked")
            work.drop()

    def _choose(self, agent: str) -> None:
        """Choose the next view of an agent, and plan its route there."""
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
                view, work.is_last = known.nearest_view(belief.pose, longest, self._sight), True
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
        """Whether there is a route to a view without the obstacles assumed for now."""
        start = self.team.belief(agent).pose[:2]
        return not self._known_for_good(agent).route(start, view.place).reason

    def _taken(self, agent: str) -> NDArray[np.float64]:
        """Return the discs (N, 3) that an agent leaves alone, since it has given them up [m].

        So it does with discs that teammates that share its map have given up or are about to see, as far as it
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
        self._given_up.append(GivenUp(agent, float(middle[0]), float(middle[1]), len(points) * cell_m, reason))

    def _reason(self, agent: str) -> str:
        """Report why an agent has no work, and the frontiers that are left."""
        borders = self._known(agent).unknown_ground(self.settings.minimum_size)
        if not borders:
            return "no_frontier"
        for points in apart_from(borders, self._taken(agent)):
            self._give_up(agent, points, "hidden")
        return "frontier_unreachable"


def _amid_bodies(known: SparseBelief, places: list[NDArray[np.float64]], belief: Belief) -> SparseBelief:
    """Return the known map with the bodies of teammates at positions (2,) [m]."""
    return known.amid(np.array(places).reshape(-1, 2), 0.9 * belief.radius, belief.robot.height)


def _place_ahead(belief: Belief) -> NDArray[np.float64]:
    """Return the place (2,) just ahead of a robot's body [m]."""
    x, y, theta = belief.pose.tolist()
    reach = belief.radius + OBSTACLE_M
    return np.array([x + reach * math.cos(theta), y + reach * math.sin(theta)])
