"""The part of a floor on which people walk: their destinations, and the path to each from every cell.

The places of a floor are far from each other along the ways between them (farthest-point sampling), and do not depend
on the episode. To each a field of headings leads: the shortest way on a lattice of about 0.1 m, at a cost that rises
near walls.
"""

import math
from dataclasses import dataclass, field

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.envs.floors.raster import Raster
from lidarium.envs.simulation.kernels.contact import distance_bound
from lidarium.envs.simulation.kernels.walking import HEADINGS, NO_WAY
from lidarium.mapping.kernels.compilation import Array, kernel

LATTICE_M = 0.1
"""Side of a cell of the lattice on which ways are planned, about [m]."""

WIDEST_M = 0.3
"""Radius of the widest person [m]."""

ROOM_M = 0.33
"""Ways keep this far from walls: the widest person, and rounding to the lattice [m]."""

COMFORT_M = 0.7
"""Cells nearer to walls than this cost more [m]."""

PLACE_ROOM_M = 0.45
"""Places are at least this far from walls, if any cell is [m]."""

MOST_PLACES, MOST_FIELD_CELLS = 16, 2_000_000
"""Maximum number of places of a floor, and of the cells of all its fields together."""

LOOKAHEAD = 4
"""Headings lead to the cell that is this many cells further along the way."""

_UNREACHED = np.int32(2**31 - 1)
_ROUND = 64
"""Buckets of the queue: more than the cost of a step."""


@dataclass(frozen=True, eq=False)
class Walkways:
    """Ways of people on a floor.

    Attributes
    ----------
    solid, bound : (rows, columns) uint8
        Solid cells up to a person's height, and the lower bound of the distance to them.
    clearance : (lattice rows, lattice columns) float32
        Distance to the nearest solid cell [m].
    headings : (places, lattice rows, lattice columns) uint8
        Heading towards each place, in parts of a turn; 255 without a way.
    places : (places, 2) float64
        x, y of the places in the floor's frame [m]; none if no person fits.
    cell : int
        Cells of the raster along one of the lattice.
    walkable : (lattice rows, lattice columns) bool
        Cells in which a person fits and from which all places can be reached.
    """

    solid: NDArray[np.uint8]
    bound: NDArray[np.uint8]
    clearance: NDArray[np.float32]
    headings: NDArray[np.uint8]
    places: NDArray[np.float64]
    cell: int
    walkable: NDArray[np.bool_] = field(repr=False)

    @property
    def row(self) -> NDArray[np.int64]:
        """The row of ``walkways`` of kernels."""
        arrays = (self.clearance, self.headings, self.places)
        return np.array(
            [
                self.solid.ctypes.data,
                self.bound.ctypes.data,
                *self.solid.shape,
                *(array.ctypes.data for array in arrays),
                len(self.places),
                self.cell,
            ],
            np.int64,
        )


def walkways_of(raster: Raster) -> Walkways:
    """Return the ways of people over the solid cells of a floor up to a person's height."""
    solid = np.ascontiguousarray(raster.solid, np.uint8)
    cell = max(round(LATTICE_M / raster.resolution), 1)
    rows, columns = solid.shape[0] // cell, solid.shape[1] // cell
    far = scipy.ndimage.distance_transform_edt(solid == 0)[cell // 2 :: cell, cell // 2 :: cell][:rows, :columns]
    clearance = np.ascontiguousarray(np.maximum((far - 0.5) * raster.resolution, 0.0), np.float32)
    _, labels, sizes, _ = cv2.connectedComponentsWithStats((clearance >= ROOM_M).view(np.uint8), connectivity=4)
    is_any = len(sizes) > 1
    walkable = labels == 1 + int(np.argmax(sizes[1:, cv2.CC_STAT_AREA])) if is_any else np.zeros(labels.shape, np.bool_)
    places, headings = _ways(walkable, clearance)
    x, y = ((places[:, axis] + 0.5) * cell * raster.resolution + raster.origin[1 - axis] for axis in (1, 0))
    where = np.ascontiguousarray(np.stack([x, y], axis=1), np.float64)
    return Walkways(solid, distance_bound(solid), clearance, headings, where, cell, walkable)


def _ways(walkable: NDArray[np.bool_], clearance: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Return places (places, 2), row and column, and the headings to each."""
    cells = int(walkable.sum())
    if cells == 0:
        return np.zeros((0, 2), np.int64), np.zeros((0, *walkable.shape), np.uint8)
    count = int(np.clip(MOST_FIELD_CELLS // walkable.size, 2, MOST_PLACES))
    wide = walkable & (clearance >= PLACE_ROOM_M)
    candidates = wide if wide.any() else walkable
    # Costs per cell of way: 1 in the open, up to 3 at walls.
    weights = np.where(walkable, np.rint(1.0 + 2.0 * np.clip(1.0 - clearance / COMFORT_M, 0.0, 1.0)), 0).astype(
        np.uint8
    )
    place = np.unravel_index(int(np.argmax(np.where(candidates, clearance, -1.0))), walkable.shape)
    nearest = np.full(walkable.shape, _UNREACHED, np.int32)
    places, headings = [], []
    for _ in range(count):
        places.append((int(place[0]), int(place[1])))
        costs, parents = spread_from(weights, places[-1][0], places[-1][1])
        headings.append(_headings(parents, LOOKAHEAD))
        nearest = np.minimum(nearest, costs)
        left = np.where(candidates & (nearest < _UNREACHED), nearest, -1)
        place = np.unravel_index(int(np.argmax(left)), walkable.shape)
        if left[place] < math.ceil(2.0 / LATTICE_M) * 5:  # nothing is 2 m away from all places
            break
    return np.array(places, np.int64), np.ascontiguousarray(np.stack(headings))


@kernel
def spread_from(weights: Array, row: int, column: int) -> tuple[Array, Array]:
    """Return costs (rows, columns) int32 of ways to a cell, and the next cell of each, by Dijkstra with buckets.

    A step costs 5, 7 if diagonal, times the weight (rows, columns) uint8 of its cell; 0 is closed.
    """
    rows, columns = weights.shape
    costs = np.full((rows, columns), _UNREACHED, np.int32)
    parents = np.full((rows, columns), -1, np.int32)
    # Every cell enters a bucket anew when its cost falls: a linked list over entries.
    first, capacity = np.full(_ROUND, -1, np.int64), 8 * rows * columns + 1
    following, cells = np.empty(capacity, np.int64), np.empty(capacity, np.int64)
    costs[row, column], count, waiting, cost = 0, 1, 1, 0
    following[0], cells[0], first[0] = -1, row * columns + column, 0
    while waiting > 0:
        bucket = cost % _ROUND
        entry = first[bucket]
        first[bucket] = -1
        while entry >= 0:
            cell, entry = cells[entry], following[entry]
            waiting -= 1
            i, j = cell // columns, cell % columns
            if costs[i, j] != cost:
                continue
            for down in range(-1, 2):
                for right in range(-1, 2):
                    k, m = i + down, j + right
                    if (down == 0 and right == 0) or k < 0 or k >= rows or m < 0 or m >= columns:
                        continue
                    if weights[k, m] == 0 or weights[i, m] == 0 or weights[k, j] == 0:
                        continue
                    step = 7 if down != 0 and right != 0 else 5
                    reached = cost + step * int(weights[k, m])
                    if reached < costs[k, m]:
                        costs[k, m], parents[k, m] = reached, cell
                        following[count], cells[count] = first[reached % _ROUND], k * columns + m
                        first[reached % _ROUND] = count
                        count += 1
                        waiting += 1
        cost += 1
    return costs, parents


@kernel
def _headings(parents: Array, lookahead: int) -> Array:
    """Return the heading from each cell to the one some cells further along its way, (rows, columns) uint8."""
    rows, columns = parents.shape
    headings = np.full((rows, columns), np.uint8(NO_WAY), np.uint8)
    for i in range(rows):
        for j in range(columns):
            if parents[i, j] < 0:
                continue
            row, column = i, j
            for _ in range(lookahead):
                ahead = parents[row, column]
                if ahead < 0:
                    break
                row, column = ahead // columns, ahead % columns
            angle = math.atan2(float(row - i), float(column - j))
            headings[i, j] = np.uint8(int(np.rint((angle + 2.0 * math.pi) / (2.0 * math.pi) * HEADINGS)) % HEADINGS)
    return headings
