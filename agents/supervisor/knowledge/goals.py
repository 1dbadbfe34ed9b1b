"""The goals that a merged map offers to robots."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.frontiers.approach import approach
from lidarium.mapping.planning.grid_planning import Cell, search

NONE = -1
"""Instead of the number of a goal, or of a cell: there is none."""


@dataclass(frozen=True, slots=True)
class Goals:
    """The frontier clusters of a merged map as goals; K of them for R robots.

    Attributes
    ----------
    cells, starts : (N, 2) int64, (K + 1,) int64
        Cells (row, column) of all clusters, and where each begins.
    seen_from : (K, 2) int64
        The cell of each that is nearest to its middle.
    sizes : (K,) float64
        Lengths [m].
    areas : (K,) float64
        What is unknown around each, within the range of the laser [m2].
    costs : (R, K) float64
        Cost of each robot's way to where it sees the frontier [m], inf where there is none.
    stands, observed : (R, K, 2) int64
        Where it stands then, and the frontier cell that it observes.
    """

    cells: NDArray[np.int64]
    starts: NDArray[np.int64]
    seen_from: NDArray[np.int64]
    sizes: NDArray[np.float64]
    areas: NDArray[np.float64]
    costs: NDArray[np.float64]
    stands: NDArray[np.int64]
    observed: NDArray[np.int64]


def find_goals(
    navigation: NavigationMap,
    origin: tuple[float, float],
    cells: Sequence[Cell],
    footprint: Footprint,
    reach: float,
    range_m: float,
) -> Goals:
    """Find the goals on a map, and what the way to each costs.

    Parameters
    ----------
    navigation : NavigationMap
        The merged map.
    origin : (x, y)
        Its lower left corner [m].
    cells : sequence of (row, column)
        Where the robots are.
    footprint : Footprint
        How they pass over the map.
    reach : float
        From how far a robot may observe a frontier [m].
    range_m : float
        Of the laser [m].
    """
    clusters = navigation.frontiers.clusters(origin)
    count, robots = len(clusters), len(cells)
    costs = np.full((robots, count), math.inf)
    stands, observed = (
        np.full((robots, count, 2), NONE, np.int64),
        np.full((robots, count, 2), NONE, np.int64),
    )
    for row, cell in enumerate(cells):
        if not count:
            break
        found = search(
            navigation.space,
            navigation.log_odds,
            navigation.clearance,
            cell,
            footprint,
        )
        near = approach(clusters, found, navigation.log_odds, reach)
        costs[row] = np.where(near.reachable, near.costs, math.inf)
        stands[row], observed[row] = near.cells, near.frontier_cells
    areas = _unknown_around(
        navigation.log_odds, clusters.representatives, range_m / 2.0, navigation.resolution
    )
    return Goals(
        clusters.cells,
        clusters.starts,
        clusters.representatives,
        clusters.sizes,
        areas,
        costs,
        stands,
        observed,
    )


def _unknown_around(
    log_odds: NDArray[np.int8], cells: NDArray[np.int64], half_side_m: float, resolution: float
) -> NDArray[np.float64]:
    """Return the unknown area in the square around each cell [m2].

    What lies beyond the map is unknown.
    """
    half = max(round(half_side_m / resolution), 1)
    sums = np.zeros((log_odds.shape[0] + 1, log_odds.shape[1] + 1), np.int64)
    sums[1:, 1:] = (log_odds != 0).cumsum(axis=0, dtype=np.int64).cumsum(axis=1)
    low = np.maximum(cells - half, 0)
    high = np.minimum(cells + half + 1, log_odds.shape)
    known = (
        sums[high[:, 0], high[:, 1]]
        - sums[low[:, 0], high[:, 1]]
        - sums[high[:, 0], low[:, 1]]
        + sums[low[:, 0], low[:, 1]]
    )
    return np.asarray(((2 * half + 1) ** 2 - known) * resolution**2, np.float64)
