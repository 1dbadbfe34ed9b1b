"""Learned: robots share out the frontiers of a map as tours, and a network chooses the first frontier of each.

All but the choice is that of `tour_frontier`, or of `predicted_tours` for networks that were trained on predicted maps:
views, driving, frontiers given up. A network that corrects nothing makes the same decisions to the bit.
"""

from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lidarium.agents.learned.decision import Chooser, Decision, Scene, choose_classic, decision_of, scene_of
from lidarium.agents.learned.network import Network, load_weights, predictor_of
from lidarium.agents.policy import Team
from lidarium.agents.predicted.planning import extra_costs
from lidarium.agents.predicted.policy import PREDICTED, PredictedTours
from lidarium.agents.tours.planning import TourOptions, first_options
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.planning.touring.tours import with_first
from lidarium.mapping.prediction.predictors import Predictor

CORRECTED = "corrected"
"""Sent elsewhere than where tours begin."""

RATE_S = 20.0
"""The rate of exploration is that of so long [s]."""


class ChosenTours(PredictedTours):
    """Explorers on tours, or on predicted tours, of which a callable chooses the first leg."""

    def __init__(
        self,
        choose: Chooser,
        predictor: str | Predictor = "nothing",
        shares_map: bool = True,
        **settings: Any,  # noqa: ANN401
    ) -> None:
        super().__init__(predictor, shares_map=shares_map, **settings)
        self.choose_option = choose

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode."""
        super().reset(team, seed)
        self._known: dict[int, deque[tuple[float, float]]] = {}

    def pick(self, agents: list[str], options: TourOptions) -> list[int | None]:
        """Return which option each robot on one map drives to, robot after robot.

        Each knows the picks of those before it; its options are ranked by the tours that are left.
        """
        navigation = self.navigation(agents[0])
        scene = scene_of(options, navigation, self._range, self.settings.weights, self._progress(navigation))
        rest, firsts = self.rest(agents[0], options), first_options(options)
        sequence, picks = options.sequence, list[int | None]()
        for robot, agent in enumerate(agents):
            extra = None if rest is None else extra_costs(rest, robot, firsts[robot], picks)
            decision = decision_of(scene, robot, sequence, picks, extra)
            if decision is not None:
                pick: int | None = self._choose(scene, robot, decision, picks)
            else:  # tours past known frontiers have nothing for it
                pick = int(np.argmin(extra)) if extra is not None and np.isfinite(extra).any() else None
            if decision is not None and pick != decision.classic:
                self._sent_by[agent] = CORRECTED
            elif rest is not None and pick != firsts[robot]:
                self._sent_by[agent] = PREDICTED
            if pick is not None:
                sequence = with_first(sequence, robot, pick, len(options.numbers))
            picks.append(pick)
        return picks

    def _choose(self, scene: Scene, robot: int, decision: Decision, picks: Sequence[int | None]) -> int:
        """Return the option that is chosen.

        It is the only option if there is one, and the robot's goal if tours go on to that:
        choices that change with every plan of the team make robots turn between targets.
        """
        if decision.mask.sum() == 1:
            return int(decision.mask.argmax())
        if scene.options.is_kept[robot, decision.classic]:
            return decision.classic
        return self._choose_among(scene, robot, decision, picks)

    def _choose_among(self, scene: Scene, robot: int, decision: Decision, picks: Sequence[int | None]) -> int:
        """Return the option that is chosen of several."""
        return self.choose_option(decision)

    def _progress(self, navigation: NavigationMap) -> dict[str, float]:
        """Return the progress of the exploration.

        These are the time [s], the free area that is known [m2] and how fast it grows [m2/s].
        """
        known = float((navigation.log_odds < 0).sum()) * navigation.resolution**2
        past = self._known.setdefault(id(navigation), deque([(0.0, 0.0)]))
        while len(past) > 1 and past[1][0] <= self.team.time_s - RATE_S:
            past.popleft()
        rate = (known - past[0][1]) / max(self.team.time_s - past[0][0], 1.0)
        past.append((self.team.time_s, known))
        return {"time": self.team.time_s, "known": known, "rate": rate}


class Learned(ChosenTours):
    """Explorers that were trained.

    Parameters
    ----------
    weights : str or Path, optional
        File of weights; those of the package by default.
    predictor : str or Predictor, optional
        Predictor of maps, as of `PredictedTours`; by default the one that the network was trained with, or none.
    """

    def __init__(
        self,
        weights: str | Path = "",
        predictor: str | Predictor = "",
        shares_map: bool = True,
        **settings: Any,  # noqa: ANN401
    ) -> None:
        super().__init__(choose_classic, predictor or predictor_of(weights), shares_map, **settings)
        self.choose_option = Network(load_weights(weights))
