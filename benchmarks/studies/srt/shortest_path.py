"""The shortest way that a disc has on a floor that is known whole."""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.simulation.kernels.floor_cache import FloorTables
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import cells_of, centres_of, plan
from lidarium.mapping.planning.search.path_search import SearchSpace

Place = tuple[float, float]


def shortest_path(tables: FloorTables, start: Place, goal: Place, radius: float) -> float | None:
    """Return the length of the shortest way [m], to a cell of the floor's raster.

    None if there is none.

    `start`, `goal` (x, y): in the floor's frame [m].
    """
    raster = tables.body
    log_odds = np.where(raster.solid, 1, -1).astype(np.int8)
    rows, columns = log_odds.shape
    clearance = ClearanceField((rows, columns), raster.resolution)
    clearance.update(log_odds, (0, rows, 0, columns))
    cells = [
        tuple(int(number) for number in cells_of(np.array(place), raster.origin, raster.resolution))
        for place in (start, goal)
    ]
    space, footprint = SearchSpace((rows, columns), raster.resolution), Footprint(radius, radius, 0.0)
    found = plan(space, log_odds, clearance, (cells[0][0], cells[0][1]), (cells[1][0], cells[1][1]), footprint)
    if found is None:
        return None
    gaps = np.sqrt(clearance.limit - clearance.closeness.astype(np.float64)) * 0.5 * raster.resolution
    places = _tightened(centres_of(found[1], (0.0, 0.0), raster.resolution), gaps, raster.resolution, radius)
    return float(sum(math.dist(first, second) for first, second in itertools.pairwise(places)))


def _tightened(
    places: NDArray[np.float64], gaps: NDArray[np.float64], resolution: float, radius: float
) -> list[NDArray[np.float64]]:
    """Leave out places of a way (n, 2) wherever the straight way past them is clear."""
    kept, at = [places[0]], 0
    while at < len(places) - 1:
        at = next(
            (
                k
                for k in range(len(places) - 1, at + 1, -1)
                if _is_clear(places[at], places[k], gaps, resolution, radius)
            ),
            at + 1,
        )
        kept.append(places[at])
    return kept


def _is_clear(
    start: NDArray[np.float64], end: NDArray[np.float64], gaps: NDArray[np.float64], resolution: float, radius: float
) -> bool:
    count = max(math.ceil(math.dist(start, end) / resolution), 1)
    cells = np.floor((start + (end - start) * np.linspace(0.0, 1.0, count + 1)[:, None]) / resolution).astype(np.int64)
    return bool((gaps[cells[:, 1], cells[:, 0]] >= radius).all())
