"""Where a robot goes to let a teammate pass."""

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import Cell, Disc, Until, centres_of, search

FARTHEST_REFUGE = (3.0, 12.0, 40.0)
"""How far a robot searches a place aside, in turn [m]."""

SAMPLE = 0.05
"""Distance between the points at which a path is compared with places [m]."""


def _sampled(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points along a path (N, 2), at most ``SAMPLE`` apart."""
    pieces = [path[:1]]
    for first, last in itertools.pairwise(path):
        count = max(int(np.ceil(np.hypot(*(last - first)) / SAMPLE)), 1)
        pieces.append(first + (last - first) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(pieces)


def obstructing(place: NDArray[np.float64], path: NDArray[np.float64], distance: float) -> bool:
    """Whether a body at a place (2,) stands within ``distance`` of a path (N, 2) [m]."""
    return bool((np.hypot(*(_sampled(path) - place).T) < distance).any())


def find_refuge(
    navigation: NavigationMap,
    origin: tuple[float, float],
    start: Cell,
    footprint: Footprint,
    discs: list[Disc],
    path: NDArray[np.float64],
    distance: float,
) -> Cell | None:
    """Find the nearest place that is off another robot's path.

    Parameters
    ----------
    navigation : NavigationMap
        The map to plan on.
    origin : (x, y)
        Its lower left corner [m].
    start : (row, column)
        Where the robot is.
    footprint : Footprint
        Its body.
    discs : list of (row, column, radius)
        Bodies of the others, in cells.
    path : (N, 2) float64
        The path to keep off [m].
    distance : float
        How far off [m].

    Returns
    -------
    (row, column) or None
        The cell that costs least to reach; None where there is none.
    """
    tree = cKDTree(_sampled(path))
    for farthest in FARTHEST_REFUGE:
        found = search(
            navigation.space,
            navigation.log_odds,
            navigation.clearance,
            start,
            footprint,
            until=Until(maximum_cost=farthest),
            blocked=discs,
        )
        cells = found.reached()
        if not len(cells):
            return None
        gaps, _ = tree.query(centres_of(cells, origin, navigation.resolution), distance_upper_bound=distance)
        free = cells[np.isinf(gaps)]
        if len(free):
            costs = [found.cost((int(row), int(column))) for row, column in free[:2000]]
            best = free[int(np.argmin(costs))]
            return int(best[0]), int(best[1])
    return None
