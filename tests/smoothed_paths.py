"""Short cuts in paths, and lines that keep clear, from the arguments that tests have."""

import numpy as np

from lidarium.mapping.planning.grid_planning import centres_of
from lidarium.mapping.planning.path_smoothing import kept_places, line_is_clear
from lidarium.mapping.planning.search.search_state import Passage, Terrain


def shortened(path, log_odds, clearance, footprint, blocked=()):
    """Cells of a path (N, 2) that are left by short cuts of a body past discs (row, column, radius)."""
    resolution, discs = clearance.resolution, np.array(list(blocked), np.float64).reshape(-1, 3)
    needed, preferred = footprint.radius / resolution, footprint.preferred / resolution
    # Short cuts do not depend on the costs of steps.
    passage = Passage(clearance.limit, np.zeros((2, 1), np.int32), 0, needed, preferred)
    return path[kept_places(path, Terrain(log_odds, clearance.closeness, passage, discs))]


def waypoints(path, log_odds, clearance, footprint, origin=(0.0, 0.0), blocked=()):
    """The same as (x, y) [m]."""
    return centres_of(shortened(path, log_odds, clearance, footprint, blocked), origin, clearance.resolution)


def line_keeps_clearance(from_cell, to_cell, log_odds, clearance, distance):
    """Whether the line between two cells is known free and keeps a distance [m] from occupied cells."""
    return line_is_clear(
        log_odds,
        clearance.closeness,
        clearance.limit,
        *(int(number) for number in (*from_cell, *to_cell)),
        distance / clearance.resolution,
    )
