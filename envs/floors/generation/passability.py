"""Whether robots can go everywhere on a generated floor, and where they start."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor, Raster, Solid
from lidarium.envs.floors.free_space import configuration_space
from lidarium.envs.floors.generation.furnishing import Furnished
from lidarium.envs.floors.generation.plans import Labels, Rectangle, metres, room_areas
from lidarium.envs.floors.generation.solids import solid_of

ROBOT_RADIUS = 0.30
"""Radius of the largest robot, which must be able to go everywhere [m]."""

MARGIN = 0.05
"""Clearance beyond that radius [m]."""

START_CLEARANCE = 0.5
"""Least distance of a start from everything that stands [m]."""

STARTS = 3
"""How many starts a floor has."""

_CHECK_RESOLUTION = 0.05


def passable(
    bounds: Rectangle, walls: tuple[Solid, ...], furniture: list[Furnished], labels: Labels
) -> tuple[list[Furnished], NDArray[np.bool_], tuple[float, float]] | None:
    """Leave out furniture until a disc can go everywhere; also where a start may be.

    None where furniture is not what is in the way.
    """
    resolution = _CHECK_RESOLUTION
    while True:
        blocks = walls + tuple(solid_of(piece.footprint, 1.0) for piece in furniture)
        raster = Floor("check", bounds, blocks).raster(resolution, 0.0, 0.5)
        space, reachable = _space(raster, ROBOT_RADIUS + MARGIN)
        tight, tight_reachable = _space(raster, ROBOT_RADIUS)
        room = _room_of_cells(labels, raster.solid.shape, raster.origin, resolution)
        reached = np.bincount(room[reachable & (room >= 0)], minlength=int(labels.max()) + 1) > 0
        missed = {k for k, area in enumerate(room_areas(labels)) if area > 0 and not reached[k]}
        # With the margin passages are wide enough; without it nooks appear that are cut off.
        stray = (space & ~reachable) | (tight & ~tight_reachable)
        if not missed and not stray.any():
            clear = configuration_space(raster, START_CLEARANCE + MARGIN)
            return furniture, clear if clear.any() else space, raster.origin
        if not furniture:
            return None
        guilty = _guilty(furniture, stray, missed, raster.origin)
        furniture = furniture[:guilty] + furniture[guilty + 1 :]


def _space(raster: Raster, radius: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return where a disc fits, and the largest connected part of that."""
    space = configuration_space(raster, radius)
    count, parts, stats, _ = cv2.connectedComponentsWithStats(space.astype(np.uint8), connectivity=4)
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA])) if count > 1 else -1
    return space, np.asarray(parts == largest)


def _guilty(
    furniture: list[Furnished], stray: NDArray[np.bool_], missed: set[int], origin: tuple[float, float]
) -> int:
    """Return the index of the last piece of furniture that obstructs the floor.

    Such a piece is beside a part cut off or in a room that is not reached. Without one, the last piece is
    returned.
    """
    reach = ROBOT_RADIUS + 3 * MARGIN
    corner = np.tile(origin, 2) + np.array([reach, reach, -reach, -reach])
    for k in range(len(furniture) - 1, -1, -1):
        left, low, right, high = np.maximum(
            (np.array(furniture[k].footprint) - corner) / _CHECK_RESOLUTION, 0.0
        ).astype(int)
        if furniture[k].room in missed or stray[low : high + 1, left : right + 1].any():
            return k
    return len(furniture) - 1


def _room_of_cells(
    labels: Labels, shape: tuple[int, ...], origin: tuple[float, float], resolution: float
) -> Labels:
    """Label of the room under each cell of a raster."""
    index = []
    for axis in (0, 1):
        centres = origin[1 - axis] + (np.arange(shape[axis]) + 0.5) * resolution
        index.append(np.clip(np.floor(centres / metres(1)).astype(int), 0, labels.shape[axis] - 1))
    return labels[np.ix_(index[0], index[1])]


def draw_starts(
    clear: NDArray[np.bool_], origin: tuple[float, float], generator: np.random.Generator
) -> NDArray[np.float64]:
    """Choose starts well off all walls, each as far as can be from the others.

    Headings are drawn.
    """
    rows, columns = np.nonzero(clear)
    places = (np.column_stack([columns, rows]) + 0.5) * _CHECK_RESOLUTION + origin
    anywhere = places[int(generator.integers(len(places)))]
    chosen = [places[int(np.argmax(((places - anywhere) ** 2).sum(axis=1)))]]
    while len(chosen) < STARTS:
        nearest = np.min([((places - place) ** 2).sum(axis=1) for place in chosen], axis=0)
        chosen.append(places[int(np.argmax(nearest))])
    headings = generator.uniform(-math.pi, math.pi, STARTS)
    return np.round(np.column_stack([np.array(chosen), headings]), 4)
