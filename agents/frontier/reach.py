"""Costs of frontiers to a robot, as far as a choice among them needs them.

A search over a whole floor costs more than all else that an explorer does, and hardly any choice needs it:
beyond some cost no frontier can make up for the way to it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.frontiers.approach import approach, default_reach
from lidarium.mapping.planning.frontiers.frontier_map import Clusters
from lidarium.mapping.planning.grid_planning import Cell, Until, search


@dataclass(frozen=True, slots=True)
class Choice:
    """The goal of a robot: the cell to drive to, and the frontier cell to observe."""

    cell: Cell
    frontier_cell: Cell


@dataclass(frozen=True, slots=True)
class Reach:
    """Cost to a robot of coming near each of K clusters.

    Attributes
    ----------
    costs : (K,) float64
        Cost of the way [m]; inf if there is none, or none up to ``beyond``.
    choices : list of Choice or None
        Cell of the robot there, and the cell that it observes.
    beyond : float
        Clusters without a finite cost cost more than this [m]; inf if they count as out of reach.
    """

    costs: NDArray[np.float64]
    choices: list[Choice | None]
    beyond: float

    def may_hold(self, utility: NDArray[np.float64], cost_weight: float, value: float) -> bool:
        """Whether a cluster beyond may have as much utility less cost as ``value``.

        Utility (K,), cost_weight [1/m].
        """
        out = ~np.isfinite(self.costs)
        return (
            math.isfinite(self.beyond)
            and bool(out.any())
            and float(utility[out].max()) - cost_weight * self.beyond >= value
        )


def reach_of(
    clusters: Clusters,
    navigation: NavigationMap,
    start: Cell,
    footprint: Footprint,
    minimum_size: float,
    slack: float,
) -> Reach:
    """Find the clusters within ``slack`` [m] of a robot's cheapest one.

    They cost the robot no more than ``slack`` above the cheapest cluster.

    The cheapest one is that of at least ``minimum_size`` [m]; of any size, if no such one is in reach.

    Parameters
    ----------
    clusters : Clusters
        The K clusters of the map's frontiers.
    navigation : NavigationMap
        The map.
    start : (row, column)
        Cell of the robot.
    footprint : Footprint
        Its body.
    minimum_size, slack : float
        See above [m].
    """
    distance = default_reach(footprint, navigation.resolution)
    for frontiers in (navigation.long_frontiers(minimum_size), navigation.frontiers):
        if not len(frontiers):
            continue
        targets = frontiers.targets(distance)
        found = search(
            navigation.space,
            navigation.log_odds,
            navigation.clearance,
            start,
            footprint,
            until=Until(targets=targets, beyond=slack),
        )
        if not len(found.hits):
            continue
        most = found.cost((int(found.hits[0, 0]), int(found.hits[0, 1]))) + slack
        near = approach(clusters, found, navigation.log_odds, distance)
        costs = np.where(near.reachable & (near.costs <= most), near.costs, math.inf)
        choices = [
            Choice((int(cell[0]), int(cell[1])), (int(seen[0]), int(seen[1]))) if math.isfinite(cost) else None
            for cost, cell, seen in zip(costs, near.cells, near.frontier_cells, strict=True)
        ]
        ended_early = found.settled * found.unit < most
        return Reach(costs, choices, math.inf if ended_early else most)
    return Reach(np.full(len(clusters), math.inf), [None] * len(clusters), math.inf)
