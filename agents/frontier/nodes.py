"""Rules at the level of nodes: the nearest node with utility, and the most utility discounted by distance.

They are the two simple planners that DARE (Cao et al., ICRA 2025) is compared with.
"""

from abc import abstractmethod
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.policy import Action, Policy, Team
from lidarium.envs.faces.parallel import Observation


class _NodePolicy(Policy):
    """Moves each robot towards the node with utility that has the most value, chosen again at every node."""

    level = "graph"

    def reset(self, team: Team, seed: int = 0) -> None:
        """Begin an episode: nothing is kept of the last one."""

    def act(self, observations: Mapping[str, Observation]) -> dict[str, Action]:
        """Choose a node for each robot; one without a node of utility stays."""
        return {agent: self._choose(observation["nodes"]) for agent, observation in observations.items()}

    def _choose(self, nodes: NDArray[np.float32]) -> int:
        lengths, utilities = nodes[:, 2].astype(np.float64), nodes[:, 3].astype(np.float64)
        if not (utilities > 0.0).any():
            return len(nodes)
        return int(np.argmax(np.where(utilities > 0.0, self._values(lengths, utilities), -np.inf)))

    @abstractmethod
    def _values(self, lengths: NDArray[np.float64], utilities: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the value of each node by the length of the way there [m] and its utility."""


class NearestNode(_NodePolicy):
    """Robots that each move to their nearest node with utility."""

    def _values(self, lengths: NDArray[np.float64], utilities: NDArray[np.float64]) -> NDArray[np.float64]:
        del utilities
        return -lengths


class UtilityNode(_NodePolicy):
    """Robots that each move to the node of most utility times exp(-distance / scale).

    Parameters
    ----------
    scale : float
        Distance over which utility falls to 1/e [m].
    """

    def __init__(self, scale: float = 20.0) -> None:
        if not scale > 0.0:
            raise ValueError(f"scale of utility_node is {scale}; want a distance above 0 m")
        self._scale = scale

    def _values(self, lengths: NDArray[np.float64], utilities: NDArray[np.float64]) -> NDArray[np.float64]:
        return utilities * np.exp(-lengths / self._scale)
