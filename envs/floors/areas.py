"""Choice of the free area of a picture that is the floor: with the starts, or the largest that is not outside."""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.raster import Raster

OUTSIDE_BORDER = 0.5
"""An area that has such a share of the picture's border may be the surroundings of a building or a track."""

BUILDING_SHARE = 0.5
"""It is, if an enclosed area spans such a share of the rectangle of all that it surrounds."""

MIN_OTHER_M2 = 1.0
"""Other areas of a picture are kept if one has this size [m2]: robots may start there."""


def floor_of_area(
    name: str,
    free: NDArray[np.bool_],
    origin: tuple[float, float],
    resolution: float,
    seed_cell: tuple[int, int] | None = None,
    starts: NDArray[np.float64] | None = None,
) -> Floor:
    """Return a floor of free cells, of which one 4-connected area stays free.

    Parameters
    ----------
    free : (rows, columns) bool
        Free cells, some but not all of them, row 0 at the lowest y.
    origin, resolution : (float, float), float
        Lower left corner of cell (0, 0) and side of a cell [m].
    seed_cell : (row, column) or None
        A cell of the area that stays free; None for the largest, or the widest if that lies around it.
    starts : (K, 3) float64 or None
        Starts that the file proposes [m, rad].
    """
    count, *found, _ = cv2.connectedComponentsWithStats(free.astype(np.uint8), connectivity=4, ltype=cv2.CV_32S)
    labels, statistics = (np.asarray(each) for each in found)
    statistics[0] = 0
    along = _border_shares(labels, len(statistics))
    label, remark = (int(labels[seed_cell]), "") if seed_cell is not None else _chosen(labels, statistics, along)
    if label == 0:
        raise ValueError(f"{name} has its start in a wall; want it in free space")
    left, bottom, width, height = (int(value) for value in statistics[label, :4])
    solid = (labels[bottom : bottom + height, left : left + width] != label).astype(np.uint8)
    corner = (origin[0] + left * resolution, origin[1] + bottom * resolution)
    bounds = (*corner, corner[0] + width * resolution, corner[1] + height * resolution)
    cells = Raster(np.pad(solid, 1, constant_values=1), (corner[0] - resolution, corner[1] - resolution), resolution)
    others = np.delete(statistics[1:count, cv2.CC_STAT_AREA], label - 1)
    has_others = others.max(initial=0) * resolution**2 >= MIN_OTHER_M2
    areas = Raster((~free).astype(np.uint8), origin, resolution) if has_others else None
    proposed = np.zeros((0, 3)) if starts is None else starts
    statistics[label] = 0
    statistics[along >= OUTSIDE_BORDER] = 0
    rest = statistics[:, cv2.CC_STAT_AREA] * resolution**2
    remarks = [each for each in (remark, left_out(rest)) if each]
    return Floor(
        name,
        bounds,
        cells=cells,
        starts=proposed,
        areas=areas,
        left_out_m2=float(rest.sum()),
        remark="; ".join(remarks),
    )


def left_out(areas_m2: NDArray[np.floating]) -> str:
    """Return a remark on areas that are free, but not connected with the floor (n,) [m2]; empty if they are small."""
    large = areas_m2[areas_m2 >= MIN_OTHER_M2]
    if not len(large):
        return ""
    where = "one other area" if len(large) == 1 else f"{len(large)} other areas"
    return f"{large.sum():.1f} m2 in {where} cannot be reached and are left out"


def around(floor: Floor, places: NDArray[np.float64]) -> Floor:
    """Return the floor of the area in which the first of some places (n, 2 or more) lies [m].

    It is the same floor if it has one area alone, or the place is in that or in a wall.
    """
    if floor.areas is None:
        return floor
    areas = floor.areas
    column, row = (
        math.floor((value - low) / areas.resolution)
        for value, low in zip(places[0, :2].tolist(), areas.origin, strict=True)
    )
    rows, columns = areas.solid.shape
    if not (0 <= row < rows and 0 <= column < columns) or areas.solid[row, column] != 0:
        return floor
    return floor_of_area(floor.name, areas.solid == 0, areas.origin, areas.resolution, (row, column), floor.starts)


def _border_shares(labels: NDArray[Any], count: int) -> NDArray[np.float64]:
    """Return the share of the picture's border that each area has."""
    border = np.concatenate([labels[0], labels[-1], labels[1:-1, 0], labels[1:-1, -1]])
    return np.asarray(np.bincount(border, minlength=count) / len(border))


def _chosen(labels: NDArray[Any], statistics: NDArray[Any], along: NDArray[np.float64]) -> tuple[int, str]:
    """Return the number of the area that is the floor, and a remark on it."""
    largest = int(np.argmax(statistics[:, cv2.CC_STAT_AREA]))
    if along[largest] < OUTSIDE_BORDER:
        return largest, ""
    enclosed = np.where(along > 0.0, 0, statistics[:, cv2.CC_STAT_WIDTH] * statistics[:, cv2.CC_STAT_HEIGHT])
    widest = int(np.argmax(enclosed))
    surrounded = labels != largest
    rows, columns = np.flatnonzero(surrounded.any(axis=1)), np.flatnonzero(surrounded.any(axis=0))
    span = (rows[-1] - rows[0] + 1) * (columns[-1] - columns[0] + 1) if len(rows) else 1
    if enclosed[widest] >= BUILDING_SHARE * span:
        return widest, "the free space along the picture's border was taken for outside"
    return largest, "the free space reaches the picture's border"
