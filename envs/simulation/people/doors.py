"""Doors in the openings of a floor: sliding leaves that open when somebody comes, are always open or always shut."""

from functools import lru_cache

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.envs.floors.drawing import draw_segments
from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.free_space import cell_of, configuration_space
from lidarium.envs.floors.raster import Raster
from lidarium.envs.simulation.kernels.arrays import (
    DOOR_END_X,
    DOOR_END_Y,
    DOOR_KIND,
    DOOR_NUMBERS,
    DOOR_OPEN,
    DOOR_X,
    DOOR_Y,
    OPENS,
    STANDS_OPEN,
    STAYS_SHUT,
)
from lidarium.envs.simulation.kernels.floor_cache import FloorTables

NARROWEST_M, WIDEST_M = 0.65, 1.6
"""Widths of openings in which a door hangs [m]."""

WIDER_M, BESIDE_M = 0.08, (0.3, 0.5)
"""Minimum additional clearance on both sides of an opening, and the distances from its middle where it is found [m]."""

APART_M = 1.0
"""Openings are at least this far apart [m]."""

INTO_WALL_M = 0.03
"""Leaves reach into the walls on both sides, so that no beam passes beside one [m]."""

WALL_BAND_M = (1.8, 1.9)
"""Height at which solids count as walls of an opening [m]."""

KINDS = (OPENS, STANDS_OPEN, STAYS_SHUT)
SHARES = (0.6, 0.3, 0.1)
"""Shares of doors that open when somebody comes, are always open, and are always shut."""

MOST_DOORS = 64
"""Maximum number of doors of a floor."""

MOST_CUT_OFF = 0.25
"""A door does not stay shut if it cuts off more than this share of the free space, or a proposed start."""

DOOR_STREAM = 0x646F6F72
"""Sets the draws of doors apart from others of the same seed."""


def openings_of(walls: Raster) -> NDArray[np.float64]:
    """Return the openings in the walls of a floor, (openings, 4): ends x, y, x, y in the floor's frame [m].

    An opening is a short passage of a door's width: its middle has walls at equal distances on two opposite sides,
    and more room before and behind.
    """
    resolution, (rows, columns) = walls.resolution, walls.solid.shape
    far, nearest = scipy.ndimage.distance_transform_edt(walls.solid == 0, return_indices=True)
    far = far * resolution
    i, j = np.nonzero((far >= 0.5 * NARROWEST_M) & (far <= 0.5 * WIDEST_M + resolution))
    wall = nearest[:, i, j]
    away = np.stack([i - wall[0], j - wall[1]]).astype(np.float64)
    length = np.hypot(*away)
    unit = away / length

    def at(steps_m: float, direction: NDArray[np.float64]) -> NDArray[np.float64]:
        place = np.rint(np.stack([i, j]) + direction * (steps_m / resolution)).astype(np.int64)
        return np.asarray(far[np.clip(place[0], 0, rows - 1), np.clip(place[1], 0, columns - 1)])

    across = np.stack([-unit[1], unit[0]])
    # The opposite wall: the distance falls to nothing as far on the other side.
    opposite = np.stack([i, j]) + unit * (length + 1.5)
    place = np.rint(opposite).astype(np.int64)
    is_wall = walls.solid[np.clip(place[0], 0, rows - 1), np.clip(place[1], 0, columns - 1)] != 0
    is_short = np.ones(len(i), np.bool_)
    for side in (1.0, -1.0):
        is_short &= np.maximum(*(at(side * gap, across) for gap in BESIDE_M)) > far[i, j] + WIDER_M
    chosen = np.flatnonzero(is_wall & is_short)
    middles = (np.stack([j[chosen], i[chosen]], axis=1) + 0.5) * resolution + np.array(walls.origin)
    reach = (length[chosen] * resolution + INTO_WALL_M)[:, None] * unit[::-1, chosen].T
    found: list[NDArray[np.float64]] = []
    taken = np.zeros((0, 2))
    for k in np.lexsort((chosen, far[i, j][chosen])):
        if not len(taken) or np.hypot(*(taken - middles[k]).T).min() >= APART_M:
            taken = np.concatenate([taken, middles[k][None]])
            found.append(np.concatenate([middles[k] - reach[k], middles[k] + reach[k]]))
    return np.array(found).reshape(-1, 4)


@lru_cache(maxsize=64)
def _openings(floor: Floor, resolution: float) -> NDArray[np.float64]:
    """Return the openings of a floor; those of floors used last are kept."""
    return openings_of(floor.raster(resolution, *WALL_BAND_M))


def draw_doors(
    tables: FloorTables, share: float, radius: float, seed: int, starts: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the doors of an episode, (doors, 7), in a share of the openings of its floor, one at least.

    A floor without openings has none. ``radius`` is that of the largest robot [m]. Doors that stay shut cut off none of
    the floor's own starts, and leave room for ``starts`` (n, 3), those of the episode if they are given.
    """
    floor = tables.floor
    if floor is None:
        openings = openings_of(tables.body)
    else:
        openings = _openings(floor, tables.body.resolution)
    if not len(openings):
        return np.zeros((0, DOOR_NUMBERS))
    generator = np.random.default_rng([seed, DOOR_STREAM])
    count = min(max(round(share * len(openings)), 1), MOST_DOORS)
    chosen = np.sort(generator.permutation(len(openings))[:count])
    doors = np.zeros((count, DOOR_NUMBERS))
    doors[:, : DOOR_END_Y + 1] = openings[chosen]
    doors[:, DOOR_KIND] = generator.choice(KINDS, count, p=SHARES)
    nowhere = np.zeros((0, 3))
    own, given = nowhere if floor is None else floor.starts, nowhere if starts is None else starts
    for door in np.flatnonzero(doors[:, DOOR_KIND] == STAYS_SHUT):
        others = doors[:door][doors[:door, DOOR_KIND] == STAYS_SHUT]
        if _cuts_off(tables.body, others, doors[door], radius, own, given):
            doors[door, DOOR_KIND] = OPENS
    doors[:, DOOR_OPEN] = doors[:, DOOR_KIND] == STANDS_OPEN
    return doors


def _cuts_off(
    raster: Raster,
    shut: NDArray[np.float64],
    door: NDArray[np.float64],
    radius: float,
    own: NDArray[np.float64],
    given: NDArray[np.float64],
) -> bool:
    """Whether a door that stays shut, with others, cuts off too much: room, a floor's own start or a given one."""
    before, after = (
        configuration_space(with_shut_doors(raster, each), radius).view(np.uint8)
        for each in (shut, np.concatenate([shut, door[None]]))
    )
    largest = max(cv2.connectedComponentsWithStats(before, connectivity=4)[2][1:, cv2.CC_STAT_AREA], default=0)
    _, labels, sizes, _ = cv2.connectedComponentsWithStats(after, connectivity=4)
    if len(sizes) == 1 or sizes[1:, cv2.CC_STAT_AREA].max() < (1.0 - MOST_CUT_OFF) * largest:
        return True
    main = 1 + int(np.argmax(sizes[1:, cv2.CC_STAT_AREA]))
    if any(labels[cell_of(raster, start)] not in (0, main) for start in own):
        return True
    cells = (cell_of(raster, start) for start in given)
    return not all((labels[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] == main).any() for i, j in cells)


def middles_of(doors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the middles x, y of doors, (doors, 2) [m]."""
    return 0.5 * (doors[:, DOOR_X : DOOR_Y + 1] + doors[:, DOOR_END_X : DOOR_END_Y + 1])


def with_shut_doors(raster: Raster, doors: NDArray[np.float64]) -> Raster:
    """Return a raster in which doors that stay shut are solid; the same one without such doors."""
    shut = doors[doors[:, DOOR_KIND] == STAYS_SHUT, : DOOR_END_Y + 1]
    if not len(shut):
        return raster
    solid = raster.solid.copy()
    draw_segments(solid, raster.origin, raster.resolution, shut, 1)
    return Raster(solid, raster.origin, raster.resolution)
