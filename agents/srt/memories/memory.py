"""Knowledge of which space was seen and where a straight path is clear."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.agents.srt.tree import Node

Place = NDArray[np.float64]
Legs = list[Place]


@dataclass(frozen=True, slots=True)
class Frontiers:
    """Frontiers that a robot can come to.

    Attributes
    ----------
    focuses : (n, 2) float64
        A place on each that is in sight from where the robot would stand [m].
    cells : list of (m, 2) float64
        The cells of each [m].
    sizes : (n,) float64
        Their lengths [m].
    costs : (n,) float64
        What the way to each costs [m], ascending.
    ahead : (n, 2) float64
        A place at the beginning of the way to each [m].
    between : callable
        Takes the numbers of some, shape (m,), and returns what the ways from place to place cost, shape (m,
        m) [m].
    legs : callable
        Takes the number of one, and returns the ends of the straight legs of the way to it.
    """

    focuses: NDArray[np.float64]
    cells: list[NDArray[np.float64]]
    sizes: NDArray[np.float64]
    costs: NDArray[np.float64]
    ahead: NDArray[np.float64]
    between: Callable[[NDArray[np.int64]], NDArray[np.float64]]
    legs: Callable[[int], Legs]


class Memory(Protocol):
    """What a robot remembers.

    Places (..., 2) are in the frame of the map's first cell [m].
    """

    def is_seen(self, points: NDArray[np.float64], of: Node) -> NDArray[np.bool_]:
        """Whether points (n, 2) beyond the border of a node were seen, shape (n,).

        The border is that of what was seen from the node.
        """
        ...

    def is_clear(self, start: Place, end: Place) -> bool:
        """Whether the robot is known to get through on a straight way."""
        ...

    def way(self, start: Place, end: Place) -> Legs | None:
        """Return the ends of the straight legs of a path across seen space.

        The last end is ``end``; None where there is no path.
        """
        ...

    def frontiers(self, start: Place, least: float, most: int) -> Frontiers | None:
        """Return the nearest frontiers of at least a length [m], so many at most.

        None where there is none.
        """
        ...

    def is_frontier(self, focus: Place) -> bool:
        """Whether what a frontier was gone to for is not seen yet."""
        ...

    def give_up(self, focus: Place) -> None:
        """Ask no more for a frontier that was observed and cannot be seen through."""
        ...
