"""Unseen cells of a known floor, and places that see them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.simulation.kernels.floor_cache import floor_tables
from lidarium.evaluation.bounds.view_graph import ViewGraph, bits_of, count, view_graph

MOST_PLACES, LEAST_SIDE = 700, 0.4
"""Floors have about so many places at most, so far apart at least [m]."""

MOST_POINTS, LEAST_SAMPLE = 4000, 0.15
"""Floors have about so many points that are to be seen at most, so far apart at least [m]."""

MOST_STOPS = 60
"""Maximum number of places for the unseen cells."""

LEAST_SEEN = 2
"""A place from which fewer points are seen is not gone to."""


@dataclass(frozen=True, slots=True)
class KnownFloor:
    """A floor that is known, in an episode.

    Attributes
    ----------
    env : ExplorationEnv
        The episode.
    graph : ViewGraph
        Places, the paths between them, and the cells seen from each.
    cells : (M, 2) int64
        The score's cells (row, column) of the points that are to be seen.
    """

    env: ExplorationEnv
    graph: ViewGraph
    cells: NDArray[np.int64]

    def node_at(self, place: NDArray[np.float64]) -> int:
        """Return the place of the graph that is nearest to a place (2,) of the floor [m]."""
        return int(np.argmin(np.hypot(*(self.graph.places - place).T)))

    def unseen(self) -> NDArray[np.uint64]:
        """Return the points that the team has not seen, a bit for each."""
        score = self.env.score
        left = score.counted_masks[0] & ~score.team_masks[0]
        words = left[self.cells[:, 0], self.cells[:, 1] >> 6]
        is_left = (words >> (self.cells[:, 1] & 63).astype(np.uint64)) & np.uint64(1)
        return bits_of(np.flatnonzero(is_left), self.graph.views.shape[1])

    def stops(self, unseen: NDArray[np.uint64], lengths: NDArray[np.float64], most: int) -> NDArray[np.int64]:
        """Return places from which all that has to be seen is seen, the nearest ones.

        They are chosen greedily by visible cells (set cover).

        Parameters
        ----------
        unseen : (words,) uint64
            Points that are left.
        lengths : (N,) float64
            Length of the path to each place [m].
        """
        wanted, left = self.env.settings.stop_coverage or 1.0, unseen.copy()
        spare = (1.0 - wanted) * len(self.cells)
        is_reached, chosen = np.isfinite(lengths), list[int]()
        while len(chosen) < MOST_STOPS and count(left) > spare:
            shown = count(self.graph.views & left) * is_reached
            best = int(np.argmax(shown))
            if shown[best] < LEAST_SEEN:
                break
            chosen.append(best)
            left &= ~self.graph.views[best]
        found = np.array(chosen, np.int64)
        return found[np.argsort(lengths[found], kind="stable")][:most]


def known_floor(env: ExplorationEnv) -> KnownFloor:
    """Return the floor of an episode that has begun."""
    settings, floor = env.settings, env.floor
    assert floor is not None
    tables = floor_tables(floor, settings.raster_resolution, settings.lidar.height, settings.robot.height)
    area = float((tables.body.solid == 0).sum()) * tables.body.resolution**2
    side = max(LEAST_SIDE, math.sqrt(area / MOST_PLACES))
    sample = max(LEAST_SAMPLE, math.sqrt(area / MOST_POINTS))
    starts = np.asarray(env.world.starts, np.float64)
    graph = view_graph(
        tables.body,
        tables.laser,
        settings.robot.radius,
        min(lidar.range_max for lidar in settings.team_lidars),
        starts,
        (side, sample),
    )
    multiple = round(settings.occupancy.resolution / settings.raster_resolution)
    return KnownFloor(env, graph, graph.points // multiple)
