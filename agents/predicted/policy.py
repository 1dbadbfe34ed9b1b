"""Predicted tours: tours as those of `tour_frontier`, chosen by what is left to see on a predicted map."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Team
from lidarium.agents.predicted.planning import costs_of, rest_of
from lidarium.agents.tours.planning import TourOptions, first_options
from lidarium.agents.tours.policy import TourFrontier
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.prediction.levels import UNKNOWN, factor_of, levels_of
from lidarium.mapping.prediction.predictors import PREDICTORS, PartialMap, Predictor, predicted

PREDICTED = "predicted"


class PredictedTours(TourFrontier):
    """Explorers on tours past what a predictor says is left."""

    def __init__(self, predictor: str | Predictor = "nothing", shares_map: bool = True, **settings: Any) -> None:  # noqa: ANN401
        super().__init__(shares_map, **settings)
        self.predictor = PREDICTORS[predictor]() if isinstance(predictor, str) else predictor

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        super().reset(team, seed)
        self.predictor.reset(team)
        self._reach = min(team.belief(agent).lidar.range_max for agent in team.agents)
        self._guesses: dict[int, tuple[float, Guess | None]] = {}
        self._enough = team.settings.stop_coverage or 1.0

    def _guess(self, navigation: NavigationMap) -> "Guess | None":
        """Return the prediction of a map as it is now, None if there is none."""
        key = id(navigation)
        if self._guesses.get(key, (None, None))[0] != self.team.time_s:
            agent = next(name for name in self.team.agents if self.navigation(name) is navigation)
            self._guesses[key] = (self.team.time_s, guess_of(self.predictor, navigation, agent))
        return self._guesses[key][1]

    def pick(self, agents: list[str], options: TourOptions) -> list[int | None]:
        """Return which option each robot on one map drives to, robot after robot."""
        guess = self._guess(self.navigation(agents[0]))
        classic = first_options(options)[: len(agents)]
        if guess is None or len(options.numbers) < 2:
            return classic
        rest = rest_of(options, guess.free, guess.unseen, guess.side, guess.factor, self._reach, self._enough)
        picks: list[int | None] = []
        for robot in range(len(agents)):
            if classic[robot] is not None and options.is_kept[robot, classic[robot]] and classic[robot] not in picks:
                picks.append(classic[robot])
                continue
            costs = costs_of(rest, robot, picks)
            picks.append(int(np.argmin(costs)) if np.isfinite(costs).any() else None)
        return picks


@dataclass(frozen=True, slots=True)
class Guess:
    """A map with its prediction.

    Attributes
    ----------
    free, unseen : (rows, columns) float32
        Probability that a square is free, and that it is free and not known.
    side, factor : float, int
        Side of a square [m], and cells of the map along it.
    """

    free: NDArray[np.float32]
    unseen: NDArray[np.float32]
    side: float
    factor: int


def guess_of(predictor: Predictor, navigation: NavigationMap, agent: str) -> Guess | None:
    """Return what a predictor says of a map."""
    factor, log_odds = factor_of(navigation.resolution), navigation.log_odds
    side = factor * navigation.resolution
    levels = levels_of(log_odds, factor)
    free = predicted(predictor, PartialMap(levels, side, agent))
    if free is None:
        return None
    unseen = np.where(levels == UNKNOWN, free, np.float32(0.0))
    return Guess(free, unseen, side, factor)
