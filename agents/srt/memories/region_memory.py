"""A memory that relies on the regions of the tree's nodes alone."""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.memories.memory import Frontiers, Legs, Place
from lidarium.agents.srt.tree import Node


class RegionMemory:
    """Memory of nodes: space is seen where it lies in another node's safe region.

    A way is clear within one node's safe region.

    Parameters
    ----------
    nodes : iterable of Node
        The nodes that the robot knows.
    """

    def __init__(self, nodes: Iterable[Node]) -> None:
        self._nodes = list(nodes)

    def is_seen(self, points: NDArray[np.float64], of: Node) -> NDArray[np.bool_]:
        """Whether points (n, 2) lie where another node is safe."""
        seen = np.zeros(len(points), np.bool_)
        for node in self._nodes:
            # A node made again at the same place sees what it saw before: its openings stay.
            if node is not of and not np.array_equal(node.place, of.place):
                seen |= node.safe.contains(points)
        return seen

    def is_clear(self, start: Place, end: Place) -> bool:
        """Whether a way begins at a node and ends within its safe region."""
        return any(
            math.dist(node.place, start) <= 0.05 and bool(node.safe.contains(end)) for node in self._nodes
        )

    def way(self, start: Place, end: Place) -> Legs | None:
        """Return None: regions know no way but the tree's."""
        return None

    def frontiers(self, start: Place, least: float, most: int) -> Frontiers | None:
        """Return None: regions have openings alone."""
        return None

    def is_frontier(self, focus: Place) -> bool:
        """Return False: there are no frontiers."""
        return False

    def give_up(self, focus: Place) -> None:
        """Do nothing."""
