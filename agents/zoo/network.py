"""Attention to frontiers and teammates in plain numpy: the network of `FrontierPolicy`.

J. Horner, "Map-merging for multi-robot system", 2016: the ranking of explore_lite, three times the path less the
size, to which the network adds a correction.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.attention import WIDTH, AttentionNetwork, Shapes, attention_shapes, linear_shapes

FRONTIERS, MASK, GAINS, TEAMMATES = "frontiers", "action_mask", "frontier_gains", "teammates"

OBSERVED = (FRONTIERS, GAINS, TEAMMATES)
"""Observables that teams of the zoo decide by, besides the mask."""

METRES, SQUARE_METRES, SECONDS = 10.0, 10.0, 60.0
"""Scales of lengths, areas and ages."""

PATH_FACTOR = 3.0
"""Cost of a metre of path in metres of frontier, as in explore_lite."""

TEAMMATE_UNITS = np.array([METRES, METRES, math.pi, METRES, METRES, 1.0, SECONDS, 1.0], np.float32)
"""Scales of the numbers of a teammate: position, heading, target, whether it has one, age, whether it is known."""


def frontier_shapes() -> Shapes:
    """Return the shape of every array of weights by name, those of `FrontierPolicy` for ``OBSERVED``."""
    return {
        "steepness": (1,),
        **linear_shapes("frontier", 7),
        **linear_shapes("teammate", len(TEAMMATE_UNITS)),
        **linear_shapes("situation", 1),
        **attention_shapes(),
        **linear_shapes("correction", WIDTH, 1),
        **linear_shapes("stay", WIDTH, 1),
    }


@dataclass(frozen=True, slots=True)
class FrontierNetwork(AttentionNetwork):
    """Ranks the frontiers on offer to a robot; teammates and frontiers are sets: their order changes nothing."""

    def choose(self, observation: Mapping[str, NDArray[Any]]) -> int:
        """Return the allowed action with the highest preference."""
        allowed = observation[MASK] > 0
        return int(np.argmax(np.where(allowed, self.preferences(observation), -np.inf)))

    def preferences(self, observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Return the preference of each action, (F + 1,) float32; the last one is to stay.

        Places without a frontier have 0; the mask rules them out.
        """
        offered = observation[MASK][:-1] > 0
        frontiers, gains = observation[FRONTIERS][offered], observation[GAINS][offered]
        teammates = observation[TEAMMATES]
        teammates = teammates[teammates[:, -1] > 0]
        numbers = [frontiers / METRES, np.log1p(frontiers[:, 2:]), gains[:, None] / SQUARE_METRES]
        tokens = [
            self.linear("situation", np.array([[offered.mean()]], np.float32)),
            self.linear("teammate", np.asarray(teammates / TEAMMATE_UNITS, np.float32)),
            self.linear("frontier", np.concatenate(numbers, axis=1, dtype=np.float32)),
        ]
        mixed = self.mixed(np.concatenate(tokens))
        found = np.zeros(len(offered) + 1, np.float32)
        classic = frontiers[:, 3] / PATH_FACTOR - frontiers[:, 2]
        correction = self.linear("correction", mixed[len(mixed) - len(frontiers) :])[:, 0]
        found[:-1][offered] = self.weights["steepness"] * classic + correction
        found[-1] = self.linear("stay", mixed[:1])[0, 0] + found[:-1].min()  # behind all, before a training
        return found
