"""Closures of loops, from when they are found until they act."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.localization.graph.closures import Closure, ClosureFinder
from lidarium.mapping.localization.graph.node_graph import NodeGraph
from lidarium.mapping.localization.matching.local_mapping import Finished
from lidarium.mapping.localization.matching.settings.slam import SlamSettings


class LoopClosing:
    """Finds closures, and keeps them until their time has come.

    Parameters
    ----------
    settings : SlamSettings
        How places are recognised, and how long a closure takes to act.
    """

    def __init__(self, settings: SlamSettings) -> None:
        self._delay_s = settings.closures.delay_s
        self._finder = ClosureFinder(settings.closures, settings.matching)
        self._due: list[tuple[float, Closure]] = []

    @property
    def pending(self) -> int:
        """How many closures were found that have not acted yet."""
        return len(self._due)

    def remember(self, ended: list[Finished], path: float) -> None:
        """Take in finished local maps, after so much of the whole path [m]."""
        for finished in ended:
            self._finder.remember(finished, path)

    def find(
        self, graph: NodeGraph, points: NDArray[np.float64], path: float, usual_score: float, time_s: float
    ) -> None:
        """Find what the last node's scan recognises.

        Parameters
        ----------
        graph : NodeGraph
            The nodes.
        points : (n, 2) float64
            The last node's scan in its own frame [m].
        path : float
            Length of the path so far [m].
        usual_score : float
            Agreement of matches of late.
        time_s : float
            Now [s].
        """
        for closure in self._finder.find(
            graph.nodes, points, graph.covariance, graph.covariance_since, path, usual_score
        ):
            self._due.append((time_s + self._delay_s, closure))

    def take_due(self, time_s: float) -> list[Closure]:
        """Return the closures whose time has come, once."""
        acting = [closure for due, closure in self._due if due <= time_s]
        if acting:
            self._due = [(due, closure) for due, closure in self._due if due > time_s]
        return acting
