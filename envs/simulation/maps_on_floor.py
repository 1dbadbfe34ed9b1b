"""The robots' maps, laid on the lattice of the scorer's masks."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.simulation import Simulation


def map_on_floor(
    simulation: Simulation, settings: ExplorationSettings, row: int, rows: slice, columns: slice
) -> NDArray[np.int8]:
    """Return a robot's log-odds within a window of the lattice of the masks of its episode; 0 beyond its map.

    Maps of robots that do not know their starts are overlaid by their true starts: with true poses that is the best
    fit of the trajectories. The window has a start and a stop within the lattice.
    """
    beliefs, episode = simulation.beliefs, row // settings.robots
    log_odds = beliefs.log_odds[row]
    if settings.known_starts:
        return laid(simulation, row, episode, log_odds)[rows, columns]
    tables, resolution = simulation.world.floors[episode], settings.occupancy.resolution
    assert tables is not None
    y, x = ((np.arange(side.start, side.stop) + 0.5) * resolution for side in (rows, columns))
    start_x, start_y, theta = simulation.world.starts[row]
    east, north = x + tables.laser.origin[0] - start_x, (y + tables.laser.origin[1] - start_y)[:, None]
    own_x = math.cos(theta) * east + math.sin(theta) * north - beliefs.origins[row, 0]
    own_y = math.cos(theta) * north - math.sin(theta) * east - beliefs.origins[row, 1]
    own_columns, own_rows = (np.floor(own / resolution).astype(np.int64) for own in (own_x, own_y))
    is_inside = (
        (own_rows >= 0) & (own_rows < log_odds.shape[0]) & (own_columns >= 0) & (own_columns < log_odds.shape[1])
    )
    placed = np.zeros(own_x.shape, np.int8)
    placed[is_inside] = log_odds[own_rows[is_inside], own_columns[is_inside]]
    return placed


def cells_beyond(simulation: Simulation, row: int, episode: int) -> tuple[int, int]:
    """Return the rows and columns by which the map of a robot that knows its start begins before the masks."""
    tables, resolution = simulation.world.floors[episode], simulation.beliefs.occupancy.resolution
    assert tables is not None
    x, y = (corner - own for corner, own in zip(tables.laser.origin, simulation.beliefs.origins[row], strict=True))
    return round(float(y) / resolution), round(float(x) / resolution)


def laid(simulation: Simulation, row: int, episode: int, log_odds: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return the part of a map of a robot that knows its start that lies on the masks' lattice, (rows, columns)."""
    first_row, first_column = cells_beyond(simulation, row, episode)
    rows, words = simulation.score.counted_masks[episode].shape
    return log_odds[first_row : first_row + rows, first_column : first_column + words * 64]
