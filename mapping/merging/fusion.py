"""One map of several that were joined.

It holds the sum of their log-odds in a common frame, and which maps know each cell.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE, LOG_ODDS_UNIT, OCCUPIED, UNKNOWN
from lidarium.mapping.kernels.compilation import Array, kernel

OCCUPIED_LOG_ODDS, FREE_LOG_ODDS = 1.0, -0.6
"""Log-odds that an occupied and a free cell of a three-level map add.

One map that reports occupied outweighs one that reports free, but not two.
"""

MAX_MAPS = 64
MAX_CELLS = 400_000_000


@dataclass(frozen=True, slots=True, eq=False)
class FusedMap:
    """The map of a group.

    Attributes
    ----------
    levels : (rows, columns) uint8
        0 occupied, 127 unknown, 255 free; row 0 at the lowest y of the common frame.
    log_odds : (rows, columns) float32
        Sum over the maps.
    sources : (rows, columns) uint64
        Bit i is set if map i knew the cell.
    origin : (x, y)
        Lower left corner of cell (0, 0) in the common frame [m], a whole number of cells.
    resolution : float
        Side of a cell [m].
    frames : mapping of str to Transform
        By the names of the robots whose maps are in it, if these are known: map their frames into the common one.
    """

    levels: NDArray[np.uint8]
    log_odds: NDArray[np.float32]
    sources: NDArray[np.uint64]
    origin: tuple[float, float]
    resolution: float
    frames: Mapping[str, Transform] = field(default_factory=dict)


def fuse(maps: Sequence[NDArray[np.uint8]], common_from_map: Sequence[Transform], resolution: float) -> FusedMap:
    """Fuse maps of one resolution.

    Parameters
    ----------
    maps : sequence of (rows, columns) uint8
        Three-level maps.
    common_from_map : sequence of Transform
        Maps the frame of each, with its origin at the lower left corner of cell (0, 0), into the common one.
    resolution : float
        Side of a cell [m].

    Returns
    -------
    FusedMap
        As large as the known area of them all.

    Raises
    ------
    ValueError
        If there is no map, more than 64, none that knows anything, or the result would be huge.
    """
    if not 0 < len(maps) <= MAX_MAPS or len(maps) != len(common_from_map):
        raise ValueError(
            f"{len(maps)} maps with {len(common_from_map)} transforms are to be fused; want 1 to {MAX_MAPS} of each"
        )
    low, high = _bounds(maps, common_from_map, resolution)
    columns, rows = (high - low).tolist()
    if rows * columns > MAX_CELLS:
        raise ValueError(
            f"the fused map would have {rows} x {columns} cells, more than {MAX_CELLS}; use a coarser resolution"
        )
    origin = (float(low[0] * resolution), float(low[1] * resolution))
    log_odds, sources = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), np.uint64)
    for index, (levels, transform) in enumerate(zip(maps, common_from_map, strict=True)):
        inverse = transform.inverse()
        pose = (inverse.x, inverse.y, inverse.theta)
        _add(np.ascontiguousarray(levels), pose, origin, resolution, np.uint64(1 << index), log_odds, sources)
    levels = np.full((rows, columns), UNKNOWN, np.uint8)
    levels[log_odds > 0.0] = OCCUPIED
    levels[log_odds < 0.0] = FREE
    return FusedMap(levels, log_odds, sources, origin, resolution)


def _bounds(
    maps: Sequence[NDArray[np.uint8]], transforms: Sequence[Transform], resolution: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the bounds of the known cells in the common frame.

    First and last column and row, exclusive.
    """
    corners = []
    for levels, transform in zip(maps, transforms, strict=True):
        is_known = levels != UNKNOWN
        if is_known.any():
            rows, columns = np.flatnonzero(is_known.any(axis=1)), np.flatnonzero(is_known.any(axis=0))
            low_x, high_x, low_y, high_y = columns[0], columns[-1] + 1, rows[0], rows[-1] + 1
            box = np.array([(low_x, low_y), (high_x, low_y), (low_x, high_y), (high_x, high_y)])
            corners.append(transform.apply(box * resolution))
    if not corners:
        raise ValueError("none of the maps knows anything; want at least one known cell")
    points = np.concatenate(corners) / resolution
    return np.floor(points.min(axis=0) + 1e-6).astype(np.int64), np.ceil(points.max(axis=0) - 1e-6).astype(np.int64)


def overlay(log_odds: NDArray[np.int8], fused: FusedMap, origin: tuple[float, float]) -> None:
    """Write the known cells of a fused map into a blank map of the same cells, in its units.

    Cells beyond it are lost.

    Parameters
    ----------
    log_odds : (rows, columns) int8
        The blank map.
    fused : FusedMap
        The fused one.
    origin : (x, y)
        Lower left corner of the blank map in the frame of the fused one, whole cells apart from its corner
        [m].
    """
    weights = np.zeros(256, np.int8)
    weights[OCCUPIED], weights[FREE] = (
        round(OCCUPIED_LOG_ODDS / LOG_ODDS_UNIT),
        round(FREE_LOG_ODDS / LOG_ODDS_UNIT),
    )
    left, low = (round((position - own) / fused.resolution) for position, own in zip(fused.origin, origin, strict=True))
    rows, columns = fused.levels.shape
    inside = log_odds[max(low, 0) : max(low + rows, 0), max(left, 0) : max(left + columns, 0)]
    first_row, first_column = max(-low, 0), max(-left, 0)
    inside[:] = weights[
        fused.levels[first_row : first_row + inside.shape[0], first_column : first_column + inside.shape[1]]
    ]


@kernel
def _add(
    levels: Array,
    map_from_common: tuple[float, float, float],
    origin: tuple[float, float],
    side: float,
    bit: int,
    log_odds: Array,
    sources: Array,
) -> None:
    """Add a map to the cells of the common grid."""
    cosine, sine = math.cos(map_from_common[2]), math.sin(map_from_common[2])
    for row in range(log_odds.shape[0]):
        y = origin[1] / side + row + 0.5
        for column in range(log_odds.shape[1]):
            x = origin[0] / side + column + 0.5
            c = int(math.floor(cosine * x - sine * y + map_from_common[0] / side))
            r = int(math.floor(sine * x + cosine * y + map_from_common[1] / side))
            if 0 <= c < levels.shape[1] and 0 <= r < levels.shape[0] and levels[r, c] != UNKNOWN:
                log_odds[row, column] += OCCUPIED_LOG_ODDS if levels[r, c] == OCCUPIED else FREE_LOG_ODDS
                sources[row, column] |= bit
