"""Attention to options and teammates in plain numpy: the networks of `FrontierPolicy` and `TourPolicy`.

At the level of frontiers the network corrects the ranking of explore_lite, three times the path less the size
(J. Horner, "Map-merging for multi-robot system", 2016); at that of tours it corrects a preference for the first stop,
which is what `tour_frontier` does.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.attention import WIDTH, AttentionNetwork, Shapes, attention_shapes, linear_shapes

FRONTIERS, TOURS, MASK, GAINS, TEAMMATES = "frontiers", "tours", "action_mask", "frontier_gains", "teammates"

OBSERVED = {"frontier": (FRONTIERS, GAINS, TEAMMATES), "tour": (TOURS, TEAMMATES)}
"""Observables that teams of the zoo decide by, besides the mask, by level."""

METRES, SQUARE_METRES, SECONDS, PLACES = 10.0, 10.0, 60.0, 5.0
"""Scales of lengths, areas, ages, and places in tours."""

OFFERS = {"frontier": 32.0, "tour": 30.0}
"""Scale of the number of options by level: the default maximum."""

PATH_FACTOR = 3.0
"""Cost of a metre of path in metres of frontier, as in explore_lite."""

OTHER_STOPS = -3.0
"""Preference of stops but the first, before a training, less the way in units of ``METRES``."""

STAY = {"frontier": 0.0, "tour": -5.0}
"""Preference of staying over the last on offer, before a training, by level."""

TEAMMATE_UNITS = np.array([METRES, METRES, math.pi, METRES, METRES, 1.0, SECONDS, 1.0], np.float32)
"""Scales of the numbers of a teammate: position, heading, target, whether it has one, age, whether it is known."""

TOUR_UNITS = np.array([METRES, METRES, METRES, SQUARE_METRES, METRES, PLACES, 1.0, 1.0], np.float32)
"""Scales of the numbers of a stop, see ``STOP_NUMBERS`` of `TourLevel`."""

OPTION_NUMBERS = {"frontier": 7, "tour": 12}
"""Numbers of an option that networks see, by level."""


def network_shapes(level: str) -> Shapes:
    """Return the shape of every array of weights by name, of networks at a level."""
    return {
        "steepness": (1,),
        **linear_shapes(level, OPTION_NUMBERS[level]),
        **linear_shapes("teammate", len(TEAMMATE_UNITS)),
        **linear_shapes("situation", 1),
        **attention_shapes(),
        **linear_shapes("correction", WIDTH, 1),
        **linear_shapes("stay", WIDTH, 1),
    }


@dataclass(frozen=True, slots=True)
class OptionNetwork(AttentionNetwork):
    """Ranks the options of a robot.

    The order of teammates and frontiers changes nothing; of stops of tours the first one is marked.
    """

    level: ClassVar[str]

    def choose(self, observation: Mapping[str, NDArray[Any]]) -> int:
        """Return the allowed action with the highest preference."""
        allowed = observation[MASK] > 0
        return int(np.argmax(np.where(allowed, self.preferences(observation), -np.inf)))

    @abstractmethod
    def options(
        self, observation: Mapping[str, NDArray[Any]], offered: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the numbers of the options on offer, (n, k), and how they are ranked before a training, (n,)."""

    def preferences(self, observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Return the preference of each action, (F + 1,) float32; the last one is to stay.

        Places without an option have 0; the mask rules them out.
        """
        offered = observation[MASK][:-1] > 0
        numbers, classic = self.options(observation, offered)
        teammates = observation[TEAMMATES]
        teammates = teammates[teammates[:, -1] > 0]
        tokens = [
            self.linear("situation", np.array([[offered.sum() / OFFERS[self.level]]], np.float32)),
            self.linear("teammate", np.asarray(teammates / TEAMMATE_UNITS, np.float32)),
            self.linear(self.level, numbers),
        ]
        mixed = self.mixed(np.concatenate(tokens))
        found = np.zeros(len(offered) + 1, np.float32)
        correction = self.linear("correction", mixed[len(mixed) - len(numbers) :])[:, 0]
        found[:-1][offered] = self.weights["steepness"] * classic + correction
        found[-1] = self.linear("stay", mixed[:1])[0, 0] + min(found[:-1].min(), 0.0) + STAY[self.level]
        return found


class FrontierNetwork(OptionNetwork):
    """Ranks frontiers."""

    level = "frontier"

    def options(
        self, observation: Mapping[str, NDArray[Any]], offered: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the numbers of frontiers, and their ranking by explore_lite."""
        frontiers, gains = observation[FRONTIERS][offered], observation[GAINS][offered]
        numbers = [frontiers / METRES, np.log1p(frontiers[:, 2:]), gains[:, None] / SQUARE_METRES]
        return np.concatenate(numbers, axis=1, dtype=np.float32), frontiers[:, 3] / PATH_FACTOR - frontiers[:, 2]


class TourNetwork(OptionNetwork):
    """Ranks stops of tours, the first one of which is what `tour_frontier` does."""

    level = "tour"

    def options(
        self, observation: Mapping[str, NDArray[Any]], offered: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the numbers of stops, and their ranking: the first one, then the nearest ones."""
        stops = observation[TOURS][offered]
        is_first = np.zeros((len(stops), 1), np.float32)
        is_first[:1] = 1.0
        numbers = [stops / TOUR_UNITS, np.log1p(stops[:, 2:5]), is_first]
        classic = np.where(is_first[:, 0] > 0, 0.0, OTHER_STOPS - stops[:, 2] / METRES)
        return np.concatenate(numbers, axis=1, dtype=np.float32), classic.astype(np.float32)


NETWORKS: dict[str, type[OptionNetwork]] = {each.level: each for each in (FrontierNetwork, TourNetwork)}
"""Networks by level."""
