"""A teacher that has the floor plan rates options: their cost if the rest were seen by short tours.

It corrects whoever explores, in all states that are reached: S. Ross, G. Gordon and D. Bagnell, "A reduction
of imitation learning and structured prediction to no-regret online learning", 2011.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.learned.decision import Chooser, Decision, Scene
from lidarium.agents.learned.network import NO_PREDICTOR
from lidarium.agents.learned.policy import ChosenTours
from lidarium.agents.tours.planning import NO_PATH, TourOptions
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.evaluation.bounds.view_graph import count
from lidarium.mapping.planning.touring.tours import TourWeights, team_tours, tours_cost
from lidarium.training.teaching.known_floor import KnownFloor, known_floor

MOST_STOPS = 16
"""Tours pass so many of the nearest stops."""

KEPT_SHARE = 0.1
"""A stop is left out if an option shows all but this share of its cells."""

VISIT_M = 0.5
"""Cost of slowing down, turning and setting out at each stop [m]."""

WEIGHTS = TourWeights(1.0, 0.4, 0.0)
"""Weights of the teacher's tours: the longest, the sum, and nothing for waiting."""


@dataclass(frozen=True, slots=True)
class Lesson:
    """A decision with the teacher's ratings.

    Attributes
    ----------
    decision : Decision
        Observation of the robot.
    regrets : (n,) float64
        By how much each option costs more than the best [m]; 0 if the mask forbids it.
    """

    decision: Decision
    regrets: NDArray[np.float64]


@dataclass(slots=True)
class _Rest:
    """The unseen cells of a scene.

    Attributes
    ----------
    scene : Scene
        Whose.
    unseen : (words,) uint64
        Points that are left.
    stops : (m,) int64
        Places from which they are seen.
    views, robots : list of int
        Places of the options, and where each robot is or will be.
    spent : list of float
        Distance of each robot [m].
    """

    scene: Scene
    unseen: NDArray[np.uint64]
    stops: NDArray[np.int64]
    views: list[int]
    robots: list[int]
    spent: list[float]


class TaughtTours(ChosenTours):
    """Explorers with a teacher that rates each option.

    Attributes
    ----------
    lessons : list of Lesson
        One for each decision so far.
    """

    def __init__(
        self,
        env: ExplorationEnv,
        choose: Chooser,
        teaching_share: float,
        seed: int,
        predictor: str = NO_PREDICTOR,
    ) -> None:
        super().__init__(choose, predictor)
        self._env, self._share = env, teaching_share
        self._generator = np.random.default_rng([seed, 5])
        self._floor: KnownFloor | None = None
        self._rest: _Rest | None = None
        self.lessons: list[Lesson] = []

    def pick(self, agents: list[str], options: TourOptions) -> list[int | None]:
        """Return which option each robot drives to."""
        self._rest = None
        self._first = agents[0]
        return super().pick(agents, options)

    def _choose_among(self, scene: Scene, robot: int, decision: Decision, picks: Sequence[int | None]) -> int:
        """Return the option that is chosen, and keep the teacher's ratings."""
        rest = self._rest = self._rest or self._rest_of(scene)
        for k, pick in enumerate(picks):
            if pick is not None:
                rest.robots[k], rest.spent[k] = rest.views[pick], float(scene.options.first[k, pick])
        regrets = self._regrets(rest, robot, decision)
        self.lessons.append(Lesson(decision, regrets))
        if self._generator.random() < self._share:
            return int(np.argmin(np.where(decision.mask, regrets, np.inf)))
        return self.choose_option(decision)

    def _rest_of(self, scene: Scene) -> _Rest:
        """Return the unseen cells of a scene."""
        floor = self._floor = self._floor or known_floor(self._env)
        row = self._env.possible_agents.index(self._first)
        offset = self._env.world.poses[row, :2] - scene.options.robots[0].pose[:2]
        views = [floor.node_at(place + offset) for place in scene.views[0]]
        robots = [floor.node_at(robot.pose[:2] + offset) for robot in scene.options.robots]
        unseen = floor.unseen()
        stops = floor.stops(unseen, floor.graph.lengths[robots].min(axis=0), MOST_STOPS)
        return _Rest(scene, unseen, stops, views, robots, [0.0] * len(robots))

    def _regrets(self, rest: _Rest, robot: int, decision: Decision) -> NDArray[np.float64]:
        """Return by how much each option costs more than the best."""
        costs = np.zeros(len(decision.mask))
        for option in np.flatnonzero(decision.mask):
            costs[option] = self._cost(rest, robot, int(option))
        return np.where(decision.mask, costs - costs[decision.mask].min(), 0.0)

    def _cost(self, rest: _Rest, robot: int, option: int) -> float:
        """Return the cost of tours that begin with an option [m]."""
        assert self._floor is not None
        graph, first = self._floor.graph, float(rest.scene.options.first[robot, option])
        view = rest.views[option]
        shown = count(graph.views[rest.stops] & rest.unseen)
        left = count(graph.views[rest.stops] & rest.unseen & ~graph.views[view])
        stops = rest.stops[left > KEPT_SHARE * shown]
        if not len(stops):
            return first * (WEIGHTS.longest + WEIGHTS.total)
        robots, spent = list(rest.robots), list(rest.spent)
        robots[robot], spent[robot] = view, first
        lengths = np.minimum(graph.lengths[:, stops], NO_PATH) + VISIT_M
        begin, between = lengths[robots] + np.array(spent)[:, None], lengths[stops]
        worth = np.zeros(len(stops))
        tours = team_tours(begin, between, worth, WEIGHTS)
        return float(tours_cost(tours, begin, between, worth, WEIGHTS))
