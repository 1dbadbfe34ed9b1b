"""Images as floors: dungeons of the exploration literature, and plain pictures.

Dungeons follow the reading rule of their projects (DRL_robot_exploration, ARiADNE and their kin): 0.1 m a
pixel, grey above 150 is free, the start is the middle of a yellow block, which is grey 208 if the file has
no colours.
"""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers.common import floor_of_cells
from lidarium.mapping.files.images import IMAGE_SUFFIXES, read_image
from lidarium.mapping.files.map_files import MAP_SERVER_GREYS, MIDDLE_GREYS, unknown_grey

SUFFIXES = IMAGE_SUFFIXES

DUNGEON_RESOLUTION = 0.1
_DUNGEON_FREE_ABOVE = 150
_MARK_GREY = 208
_FREE_ABOVE = 127


def is_dungeon(path: Path) -> bool:
    """Return whether an image is a dungeon.

    A dungeon has a start mark, a grey for walls and a grey for free space.
    """
    pixels = read_image(path)
    mark = _mark(pixels)
    levels = _levels(_grey(pixels), ~mark)
    walls, free = levels[levels <= _DUNGEON_FREE_ABOVE], levels[levels > _DUNGEON_FREE_ABOVE]
    return bool(mark.any() and walls.size and free.size and np.ptp(walls) <= 1 and np.ptp(free) <= 1)


def load_dungeon(path: Path, resolution: float | None) -> Floor:
    """Read a dungeon with its start; unreachable cells are solid."""
    side = DUNGEON_RESOLUTION if resolution is None else resolution
    pixels = read_image(path)
    mark = _mark(pixels)[::-1]
    row, column = (float(indices.mean()) for indices in np.nonzero(mark))
    free = (_grey(pixels) > _DUNGEON_FREE_ABOVE)[::-1] | mark
    start = np.array([[(column + 0.5) * side, (row + 0.5) * side, 0.0]])
    return floor_of_cells(path, free, (0.0, 0.0), side, seed_cell=(int(row), int(column)), starts=start)


def load_image(path: Path, resolution: float | None) -> Floor:
    """Read a picture: grey above 127 is free.

    The grey that mappers write for unknown is solid.
    """
    if resolution is None:
        raise ValueError(
            f"{path} is an image without a scale; want image_resolution (--resolution), its metres per pixel"
        )
    grey = _grey(read_image(path))
    free = grey > _FREE_ABOVE
    unknown = unknown_grey(grey, (MAP_SERVER_GREYS, MIDDLE_GREYS))
    if unknown is not None:
        free &= grey != unknown
    return floor_of_cells(path, free[::-1], (0.0, 0.0), resolution)


def _grey(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """Return the greys of a picture, on white where it is transparent."""
    eight = pixels if pixels.dtype == np.uint8 else (pixels // 257).astype(np.uint8)
    if eight.ndim == 2:
        return eight
    if eight.shape[2] == 2:
        grey = eight[..., 0]
    else:
        grey = np.asarray(cv2.cvtColor(np.ascontiguousarray(eight[..., :3]), cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    if eight.shape[2] == 3:
        return grey
    solid = eight[..., -1].astype(np.uint32)
    return ((grey * solid + 255 * (255 - solid) + 127) // 255).astype(np.uint8)


def _levels(grey: NDArray[np.uint8], where: NDArray[np.bool_] | None = None) -> NDArray[np.int64]:
    """Return the greys that there are, in ascending order, without a copy of the picture."""
    mask = None if where is None else where.view(np.uint8)
    counts = cv2.calcHist([grey], [0], mask, [256], [0.0, 256.0])
    return np.flatnonzero(counts).astype(np.int64)


def _mark(pixels: NDArray[Any]) -> NDArray[np.bool_]:
    """Return the pixels of the start mark.

    The mark is yellow, or grey 208 in an image without colours.
    """
    if pixels.ndim == 3 and pixels.shape[2] >= 3:
        maximum, rest = np.iinfo(pixels.dtype).max, [0] * (pixels.shape[2] - 3)
        minimum, greatest = (0, 151, 151, *rest), (99, maximum, maximum, *(maximum for _ in rest))
        yellow = cv2.inRange(pixels, np.array(minimum), np.array(greatest))
        if yellow.any():
            return yellow > 0
    return np.asarray(_grey(pixels) == _MARK_GREY)
