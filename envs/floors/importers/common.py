"""Shared parts of several importers.

They read text, find the free areas of pixel floors and put walls around line drawings.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.areas import floor_of_area
from lidarium.envs.floors.drawing import fill_shapes, strip, strip_edges
from lidarium.envs.floors.floor import Floor, Solid, check_extent
from lidarium.mapping.files.guarded_reading import printable
from lidarium.mapping.files.guarded_reading import read_text as read_guarded
from lidarium.mapping.files.images import MAX_PIXELS

MAX_TEXT_BYTES = 32 << 20
"""Longest text of a floor, unpacked: parsed it takes some twenty times as much."""

MAX_POINTS = 250_000
"""Maximum number of points of a drawing."""

Part = TypeVar("Part")

# Wall thickness for drawings that give none [m].
WALL_THICKNESS = 0.1

# Gaps in the outer wall of a drawing that are tried until it is closed [m], and the share of the largest area
# wanted.
_GAPS = (0.0, 0.2, 0.5, 1.0, 2.0)
_CLOSED_SHARE = 0.85
_OUTLINE_RESOLUTION = 0.02
_MAX_OUTLINE_CELLS = 20_000_000  # 8,000 m2; wider drawings have coarser cells


def read_text(path: Path) -> str:
    """Return the text of a file, unpacked if its name ends in .gz."""
    return read_guarded(path, MAX_TEXT_BYTES)


def floor_name(path: Path) -> str:
    """Return the file's name without the ending of its format."""
    name = printable(path.name)
    for suffix in (".gz", ".txt", ".vectormap", ".xml", ".json"):
        if name.lower().endswith(suffix):
            name = name[: -len(suffix)]
    return Path(name).stem if len(name) == len(path.name) else name


def is_number(word: str) -> bool:
    """Return whether a word is a finite number."""
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def refuse_resolution(path: Path, resolution: float | None) -> None:
    """Raise ValueError if a resolution is given for a file that has its own scale."""
    if resolution is not None:
        raise ValueError(f"{path} has its own scale, but a resolution of {resolution} m is given; want none")


def few_enough(path: Path, parts: Iterable[Part], points_of: Callable[[Part], int]) -> Iterator[Part]:
    """Yield parts of a drawing, as long as they have not too many points."""
    points = 0
    for part in parts:
        points += points_of(part)
        if points > MAX_POINTS:
            raise ValueError(f"{path} has more than {MAX_POINTS:,} points; want a plan, or a picture of it")
        yield part


def floor_of_cells(
    path: Path,
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
        Free cells, row 0 at the lowest y.
    origin, resolution : (float, float), float
        Lower left corner of cell (0, 0) and side of a cell [m].
    seed_cell : (row, column) or None
        A cell of the area that stays free; None for the largest that is not outside.
    starts : (K, 3) float64 or None
        Starts that the file proposes [m, rad].
    """
    if free.size > MAX_PIXELS:
        raise ValueError(f"{path} has {free.size:,} cells; want at most {MAX_PIXELS:,}")
    if not free.any() or free.all():
        raise ValueError(
            f"{path} is {'all free' if free.any() else 'all solid'}; want a floor with free space and walls"
        )
    return floor_of_area(floor_name(path), free, origin, resolution, seed_cell, starts)


def floor_of_lines(path: Path, walls: NDArray[np.float64], openings: NDArray[np.float64]) -> Floor:
    """Return a floor of a line drawing; areas that are not enclosed are solid.

    Parameters
    ----------
    walls : (N, 4) float64
        Wall lines x1, y1, x2, y2 [m]; they become `WALL_THICKNESS` thick.
    openings : (M, 4) float64
        Lines that are passable inside the building, but close its outline [m].
    """
    everything = np.concatenate([walls, openings])
    low, high = everything.reshape(-1, 2).min(axis=0), everything.reshape(-1, 2).max(axis=0)
    check_extent(str(path), (*low.tolist(), *high.tolist()), everything.reshape(-1, 2, 2))
    solids = [Solid(strip(wall, WALL_THICKNESS, overhang=WALL_THICKNESS / 2.0)) for wall in walls]
    half = WALL_THICKNESS / 2.0
    bounds = (low[0] - half, low[1] - half, high[0] + half, high[1] + half)
    surroundings = Solid(_box(low - 1.0, high + 1.0), holes=enclosed(path, everything, low, high))
    return Floor(
        floor_name(path),
        (float(bounds[0]), float(bounds[1]), float(bounds[2]), float(bounds[3])),
        (surroundings, *solids),
    )


def _box(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array([low, (high[0], low[1]), high, (low[0], high[1])])


def enclosed(
    path: Path, lines: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Return the outlines of enclosed areas, between the lowest and the highest of their ends.

    The outlines run along the middle of the outer walls.

    Drawings have gaps in the outer wall. They are closed by widening the lines, step by step, until nearly as much
    is enclosed as with the widest. Areas that a smaller widening encloses keep their finer outline.
    """
    widest = max(_GAPS) + WALL_THICKNESS
    size = high - low + 2.0 * widest
    resolution = max(_OUTLINE_RESOLUTION, float(np.sqrt(size.prod() / _MAX_OUTLINE_CELLS)))
    origin = (float(low[0] - widest), float(low[1] - widest))
    drawn = np.zeros((int(size[1] / resolution) + 1, int(size[0] / resolution) + 1), dtype=np.uint8)
    fill_shapes(drawn, origin, resolution, strip_edges(lines, WALL_THICKNESS, 0.5), 1)
    union = _inside((1 - drawn).astype(np.float32), 0.0, resolution).view(np.uint8)
    # No widening encloses more than the box of the lines: lines without gaps are not widened at all.
    if np.count_nonzero(union) >= _CLOSED_SHARE * np.prod((high - low) / resolution + 4.0):
        return _outlines(path, union, origin, resolution)
    distance = _distance(1 - drawn, resolution)
    insides, areas = [np.packbits(union)], [np.count_nonzero(union)]
    for gap in _GAPS[1:]:
        union |= _inside(distance, gap / 2.0, resolution)
        insides.append(np.packbits(union))  # five of them, of up to 20 MB each
        areas.append(np.count_nonzero(union))
    closed = next(k for k, area in enumerate(areas) if area >= _CLOSED_SHARE * areas[-1])
    inside = np.unpackbits(insides[closed], count=union.size).reshape(union.shape)
    return _outlines(path, inside, origin, resolution)


def _outlines(
    path: Path, inside: NDArray[np.uint8], origin: tuple[float, float], resolution: float
) -> tuple[NDArray[np.float64], ...]:
    contours, _ = cv2.findContours(inside, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    rings = [contour[:, 0, :].astype(np.float64) for contour in contours if len(contour) >= 3]
    # The middle of a widened line may count by a rounding, as a row of cells without an area.
    if not rings:
        raise ValueError(f"{path} has no walls that enclose a space; want a floor plan")
    return tuple((ring + 0.5) * resolution + origin for ring in rings)


def _inside(distance: NDArray[np.float32], widening: float, resolution: float) -> NDArray[np.bool_]:
    """Return the area enclosed between the widened lines.

    It cannot be reached from the border; half of the wall is taken off it.
    """
    reached = (distance > widening).astype(np.uint8)
    cv2.floodFill(reached, None, (0, 0), (2,))
    return np.asarray(_distance((reached != 2).view(np.uint8), resolution) > widening + WALL_THICKNESS / 2.0)


def _distance(cells: NDArray[np.uint8], resolution: float) -> NDArray[np.float32]:
    """Return how far each cell is from the nearest that is zero [m]."""
    distance = np.asarray(cv2.distanceTransform(cells, cv2.DIST_L2, 5), np.float32)
    distance *= resolution
    return distance
