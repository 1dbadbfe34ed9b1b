"""Predicted tours: tours as those of `tour_frontier`, begun by what is left to see on a predicted map.

Options, views, driving and frontiers given up are those of `tour_frontier`; a predictor that predicts nothing makes the
same decisions to the bit. With a prediction, robots set out to the option after which the rest costs least: tours past
places from which all that is probably free and unseen is seen, on paths through what is probably free.
"""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Team
from lidarium.agents.predicted.planning import Rest, extra_costs, rest_of
from lidarium.agents.tours.planning import TourOptions, first_options
from lidarium.agents.tours.policy import TourFrontier
from lidarium.mapping.geometry.bounds import shown
from lidarium.mapping.prediction.levels import factor_of, levels_of, shares_unknown
from lidarium.mapping.prediction.network_predictor import NetworkPredictor
from lidarium.mapping.prediction.predictors import (
    PartialMap,
    Predictor,
    begin_episode,
    check_predictor,
    make_predictor,
    predicted,
)

PREDICTED = "predicted"
"""Sent by the prediction to an option other than the first of the tour."""


class PredictedTours(TourFrontier):
    """Explorers on tours past the area that is probably left.

    Parameters
    ----------
    predictor : str or Predictor, optional
        Name of a predictor, or an object with its method ``predict``. "network" by default.
    weights : str or Path, optional
        File of the network's weights; those of the package by default.
    falls_back : bool, optional
        Whether robots go on by `tour_frontier` if the predictor fails, with a warning; by default its error is raised.
    """

    def __init__(
        self,
        predictor: str | Predictor = "network",
        weights: str | Path = "",
        falls_back: bool = False,
        shares_map: bool = True,
        **settings: Any,  # noqa: ANN401
    ) -> None:
        super().__init__(shares_map, **settings)
        if not isinstance(falls_back, bool):
            raise ValueError(f"falls_back is {shown(falls_back)}; want True or False")
        if isinstance(predictor, str):
            predictor = make_predictor(predictor, **({} if weights == "" else {"weights": weights}))
        check_predictor(predictor)
        self.predictor = predictor
        self.predicts = isinstance(predictor, NetworkPredictor)
        self._falls_back = falls_back

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        super().reset(team, seed)
        begin_episode(self.predictor, team)
        self._range = min(team.belief(agent).lidar.range_max for agent in team.agents)
        self._enough = team.settings.stop_coverage or 1.0
        self._has_failed = False

    def pick(self, agents: list[str], options: TourOptions) -> list[int | None]:
        """Return which option each robot on one map drives to, robot after robot; each knows the picks before it.

        A robot keeps its goal if tours go on to that.
        """
        classic = first_options(options)[: len(agents)]
        rest = self.rest(agents[0], options)
        if rest is None:
            return classic
        picks: list[int | None] = []
        for robot, first in enumerate(classic):
            extra = extra_costs(rest, robot, first, picks)
            picks.append(int(np.argmin(extra)) if np.isfinite(extra).any() else None)
            if picks[robot] != first:
                self._sent_by[agents[robot]] = PREDICTED
        return picks

    def rest(self, agent: str, options: TourOptions) -> Rest | None:
        """Return the unseen area of a robot's predicted map.

        None if it is too small for a stop, if nothing is predicted, or if there is only one option.
        """
        if len(options.numbers) < 2:
            return None
        navigation = self.navigation(agent)
        factor = factor_of(navigation.resolution)
        side = factor * navigation.resolution
        free = self._predicted(PartialMap(levels_of(navigation.log_odds, factor), side, agent))
        if free is None:
            return None
        unseen = free * shares_unknown(navigation.log_odds, factor)
        return rest_of(options, free, unseen, (side, factor), self._range, self._enough)

    def _predicted(self, partial: PartialMap) -> NDArray[np.float32] | None:
        """Return the prediction of a map, None if there is none."""
        if not self._falls_back:
            return predicted(self.predictor, partial)
        if self._has_failed:
            return None
        try:
            return predicted(self.predictor, partial)
        except Exception as error:  # whatever a predictor of the user's own raises
            self._has_failed = True
            warnings.warn(f"the predictor failed, and robots go on without it: {error}", UserWarning, stacklevel=2)
            return None
