"""LIFULL apartments: walls, openings and rooms as tab-separated lines.

The lines are ``x1 y1 x2 y2 label ...`` in pixels, y down.

The annotation has no scale: its median opening is taken as 0.8 m wide.

References
----------
C. Liu et al., Raster-to-Vector: Revisiting Floorplan Transformation, ICCV 2017 (the annotation).
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor, check_pairs
from lidarium.envs.floors.importers.common import (
    WALL_THICKNESS,
    floor_of_lines,
    is_number,
    read_text,
    refuse_resolution,
)

OPENING_WIDTH = 0.8
MAX_PIXEL = 1e9
"""Farthest coordinate of an annotation [pixels]."""

# Shorter pieces of wall than this next to an opening are annotation errors [m].
_SLIP = 0.02


def matches(path: Path) -> bool:
    """Return whether the first line of text is four numbers and a label."""
    words = read_text(path).lstrip().split("\n", 1)[0].split()
    return len(words) >= 5 and all(is_number(word) for word in words[:4])


def load(path: Path, resolution: float | None) -> Floor:
    """Read an annotation of an apartment as a floor.

    Walls are solid, doors are open, and everything outside the outer walls is solid.
    """
    refuse_resolution(path, resolution)
    lines = _lines(path)
    walls, doors = (np.array(lines[label], dtype=np.float64).reshape(-1, 4) for label in ("wall", "door"))
    widths = np.hypot(doors[:, 2] - doors[:, 0], doors[:, 3] - doors[:, 1])
    if len(walls) == 0 or not (len(doors) and np.median(widths) > 0.0):
        raise ValueError(f"{path} has {len(walls)} walls and {len(doors)} doors; want both, as doors give the scale")
    if np.abs(np.concatenate([walls, doors])).max() > MAX_PIXEL:
        raise ValueError(f"{path} has coordinates beyond {MAX_PIXEL:g} pixels; want an annotation")
    scale = OPENING_WIDTH / float(np.median(widths))
    everything = np.concatenate([walls, doors])
    left, bottom = everything[:, [0, 2]].min(), everything[:, [1, 3]].max()
    to_metres = np.array([scale, -scale, scale, -scale])
    walls, doors = ((part - [left, bottom, left, bottom]) * to_metres for part in (walls, doors))
    check_pairs(str(path), len(walls), len(doors))
    pieces = [piece for wall in walls for piece in _without_doors(wall, doors)]
    return floor_of_lines(path, np.array(pieces).reshape(-1, 4), doors)


def _lines(path: Path) -> dict[str, list[list[float]]]:
    lines: dict[str, list[list[float]]] = {"wall": [], "door": []}
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        try:
            corners = [float(word) for word in words[:4]]
            label = words[4]
        except (ValueError, IndexError):
            raise ValueError(f"{path}, line {number}: {line[:60]!r} is no annotation; want x1 y1 x2 y2 label") from None
        if not np.isfinite(corners).all():
            raise ValueError(f"{path}, line {number}: {line[:60]!r} has coordinates that are not finite")
        if label in lines:
            lines[label].append(corners)
    return lines


def _without_doors(wall: NDArray[np.float64], doors: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the rest of a wall between the doors that lie along it."""
    start, end = wall[:2], wall[2:]
    length = float(np.hypot(*(end - start)))
    if length == 0.0:
        return []
    along = (end - start) / length
    across = np.array([-along[1], along[0]])
    gaps = []
    for door in doors.reshape(-1, 2, 2):
        offsets = (door - start) @ across
        if np.abs(offsets).max() <= WALL_THICKNESS:
            first, last = sorted(np.clip((door - start) @ along, 0.0, length).tolist())
            gaps.append((first, last))
    pieces, reached = [], 0.0
    for first, last in [*sorted(gaps), (length, length)]:
        if first - reached > _SLIP:
            pieces.append(np.concatenate([start + along * reached, start + along * first]))
        reached = max(reached, last)
    return pieces
