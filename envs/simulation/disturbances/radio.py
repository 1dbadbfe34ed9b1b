"""Radio: which robots reach each other.

Reach is by distance, by line of sight, or by signal strength through walls.

References
----------
Path loss through obstacles, parameters and threshold of ``signal``: IR2 (Tan et al., "IR2: Implicit
Rendezvous for Robotic Exploration Teams under Sparse Intermittent Connectivity", IROS 2024); its pixels are
taken as 0.1 m.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Raster
from lidarium.envs.settings.radio import RadioSettings
from lidarium.mapping.kernels.compilation import Array, kernel

RADIO_STREAM = 0x72616469
"""Sets the draws of the radio apart from others of the same seed."""

OBSTACLE_UNIT = 0.1
"""Unit of the obstacle length in the path-loss formula [m].

It is the length of wall that adds no loss to the fixed loss of a wall.
"""


@kernel
def solid_length(solid: Array, x: float, y: float, to_x: float, to_y: float) -> float:
    """Length of a line within solid cells, from x, y to another place, in cells.

    Beyond the raster nothing is solid (kernel).

    Parameters
    ----------
    solid : (rows, columns) uint8
        1 if the world is solid.
    x, y, to_x, to_y : float
        The ends of the line [cells].
    """
    gap_x, gap_y = to_x - x, to_y - y
    length = math.hypot(gap_x, gap_y)
    if length == 0.0:
        return 0.0
    column, row = int(math.floor(x)), int(math.floor(y))
    step_x, step_y = (1 if gap_x > 0.0 else -1), (1 if gap_y > 0.0 else -1)
    every_x = 1.0 / abs(gap_x) if gap_x != 0.0 else math.inf
    every_y = 1.0 / abs(gap_y) if gap_y != 0.0 else math.inf
    next_x = ((column + (1 if step_x > 0 else 0)) - x) / gap_x if gap_x != 0.0 else math.inf
    next_y = ((row + (1 if step_y > 0 else 0)) - y) / gap_y if gap_y != 0.0 else math.inf
    share, inside = 0.0, 0.0
    while share < 1.0:
        after = min(next_x, next_y, 1.0)
        if 0 <= row < solid.shape[0] and 0 <= column < solid.shape[1] and solid[row, column] != 0:
            inside += after - share
        share = after
        if next_x <= next_y:
            column += step_x
            next_x += every_x
        else:
            row += step_y
            next_y += every_y
    return inside * length


@kernel
def _wall_lengths(solid: Array, places: Array, lengths: Array) -> None:
    """Fill ``lengths`` (robots, robots) with the solid part of each line [cells].

    The lines join any two of the places (robots, 2), also in cells.
    """
    for i in range(places.shape[0]):
        lengths[i, i] = 0.0
        for j in range(i):
            lengths[i, j] = lengths[j, i] = solid_length(solid, places[i, 0], places[i, 1], places[j, 0], places[j, 1])


def path_loss(
    settings: RadioSettings, distance: NDArray[np.float64], walls: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the loss over a distance, part of which is through solids [dB].

    Parameters
    ----------
    distance, walls : (...) float64
        Length of the whole path, and of its part in solids [m]. A free path shorter than ``reference_distance`` has
        the loss at that distance.
    """
    free = np.maximum(distance - walls, 0.0)
    loss = settings.reference_loss + 10.0 * settings.free_exponent * np.log10(
        np.maximum(free / settings.reference_distance, 1.0)
    )
    through = settings.wall_loss + 10.0 * settings.wall_exponent * np.log10(np.maximum(walls / OBSTACLE_UNIT, 1.0))
    return np.asarray(loss + np.where(walls > 0.0, through, 0.0), np.float64)


def connects(settings: RadioSettings, distance: float) -> bool:
    """Whether robots may reach each other over a distance [m] with nothing between; by shadowing, they may."""
    is_lucky = settings.kind == "signal" and settings.shadowing > 0.0
    return is_lucky or bool(_reached(settings, np.array(distance), np.array(0.0), None))


def _reached(
    settings: RadioSettings,
    distance: NDArray[np.float64],
    walls: NDArray[np.float64],
    chance: NDArray[np.float64] | None,
) -> NDArray[np.bool_]:
    """Return over which links a message arrives.

    Inputs are their lengths and solid lengths [m], and the draws for the shadowing.
    """
    if settings.kind in ("all", "none"):
        return np.full(distance.shape, settings.kind == "all")
    if settings.kind == "range":
        return np.asarray(distance <= settings.reach)
    if settings.kind == "line_of_sight":
        return np.asarray((distance <= settings.reach) & (walls == 0.0))
    loss = path_loss(settings, distance, walls)
    if chance is not None:
        loss = loss + settings.shadowing * chance
    return np.asarray(settings.power - loss > settings.threshold)


def asks_for_walls(settings: RadioSettings) -> bool:
    """Whether walls between robots affect links."""
    return settings.kind in ("line_of_sight", "signal")


def links(
    settings: RadioSettings,
    places: NDArray[np.float64],
    raster: Raster,
    chance: NDArray[np.float64] | None = None,
) -> NDArray[np.bool_]:
    """Return which robots reach each other, (robots, robots), False on the diagonal.

    Parameters
    ----------
    places : (robots, 2 or more) float64
        True places of the robots [m].
    chance : (robots, robots) float64 or None
        Standard Gaussian draws for the shadowing, used above the diagonal; None for no shadowing.
    """
    robots = len(places)
    distance = np.hypot(places[:, None, 0] - places[None, :, 0], places[:, None, 1] - places[None, :, 1])
    walls = np.zeros((robots, robots))
    if asks_for_walls(settings):
        _wall_lengths(raster.solid, (places[:, :2] - raster.origin) / raster.resolution, walls)
        walls *= raster.resolution
    above = None if chance is None else np.triu(chance, 1)
    return np.asarray(
        _reached(settings, distance, walls, None if above is None else above + above.T)
        & ~np.eye(robots, dtype=np.bool_)
    )


def links_to(
    settings: RadioSettings,
    places: NDArray[np.float64],
    place: NDArray[np.float64],
    raster: Raster,
    chance: NDArray[np.float64] | None = None,
) -> NDArray[np.bool_]:
    """Return which robots reach a place, and are reached from it, (robots,).

    Parameters
    ----------
    place : (2,) float64
        Position of the other end [m].
    chance : (robots,) float64 or None
        Standard Gaussian draws for the shadowing; None for no shadowing.
    """
    distance = np.hypot(places[:, 0] - place[0], places[:, 1] - place[1])
    walls = np.zeros(len(places))
    if asks_for_walls(settings):
        ends = (np.vstack([places[:, :2], place[None, :2]]) - raster.origin) / raster.resolution
        x, y = ends[-1].tolist()
        walls[:] = [solid_length(raster.solid, from_x, from_y, x, y) for from_x, from_y in ends[:-1].tolist()]
        walls *= raster.resolution
    return _reached(settings, distance, walls, chance)
