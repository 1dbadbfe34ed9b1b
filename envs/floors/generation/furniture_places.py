"""Places for furniture: against the walls of rooms or free in them, off doors and passages."""

import math
from bisect import bisect_left
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from lidarium.envs.floors.floor import Solid
from lidarium.envs.floors.generation.furniture import place
from lidarium.envs.floors.generation.plans import CELL, Boundary, Door, Labels, Rectangle, boundaries

PASSAGE = 0.75
"""Clear width before a piece and between two separate pieces [m].

Pieces are separate where they do not stand side by side.
"""

DOOR_DEPTH = 0.95
"""Depth of the clear rectangle at both sides of a door [m]."""

ATTEMPTS = 10
"""Draws of a place for one piece before it is left out."""

FREE = frozenset({"desk group", "desk pair", "dining table", "low table", "meeting table", "table"})
"""Pieces that stand free in a room."""


@dataclass(frozen=True, slots=True)
class Furnished:
    """A piece of furniture in its room: room label, footprint and solids."""

    room: int
    footprint: Rectangle
    solids: tuple[Solid, ...]


class FurniturePlaces:
    """Where furniture can still stand: walls by room, and what is taken or kept clear.

    Parameters
    ----------
    labels : (rows, columns) int32
        The plan.
    doors : list of Door
        What to keep clear.
    wall_thickness : float
        Of the walls between rooms [m].
    """

    def __init__(self, labels: Labels, doors: list[Door], wall_thickness: float) -> None:
        self._labels = labels
        self._half_wall = wall_thickness / 2
        self._walls: dict[int, list[tuple[Boundary, bool]]] = {}
        for boundary in boundaries(labels):
            for room, above in ((boundary.low, False), (boundary.high, True)):
                self._walls.setdefault(room, []).append((boundary, above))
        self._clear: dict[int, list[Rectangle]] = {}
        for door in doors:
            rectangle = door.boundary.rectangle(door.start - 0.1, door.end + 0.1, DOOR_DEPTH, DOOR_DEPTH)
            for room in (door.boundary.low, door.boundary.high):
                self._clear.setdefault(room, []).append(rectangle)
        self._taken: dict[int, list[tuple[Rectangle, Boundary | None]]] = {}
        rows: dict[int, tuple[slice, slice]] = {}
        for room in range(int(labels.max()) + 1):
            inside = labels == room
            row, column = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
            if row.size:
                rows[room] = (
                    slice(int(row[0]), int(row[-1]) + 1),
                    slice(int(column[0]), int(column[-1]) + 1),
                )
        self._extent = rows

    def draw(
        self, room: int, name: str, width: float, depth: float, generator: np.random.Generator
    ) -> Furnished | None:
        """Try a few places for a piece; None where none of them is free."""
        for _ in range(ATTEMPTS):
            wall: Boundary | None = None
            if name in FREE:
                rectangle, theta = self._free(room, width, depth, generator)
            else:
                against = self._against_wall(room, width, depth, generator)
                if against is None:
                    return None
                rectangle, theta, wall = against
            if self._is_free(room, rectangle, wall):
                self._taken.setdefault(room, []).append((rectangle, wall))
                x, y = (rectangle[0] + rectangle[2]) / 2, (rectangle[1] + rectangle[3]) / 2
                return Furnished(room, rectangle, place(name, x, y, theta, width, depth))
        return None

    def _free(
        self, room: int, width: float, depth: float, generator: np.random.Generator
    ) -> tuple[Rectangle, float]:
        rows, columns = self._extent[room]
        turned = generator.random() < 0.5
        across, along = (depth, width) if turned else (width, depth)
        middle_x, middle_y = (columns.start + columns.stop) * CELL / 2, (rows.start + rows.stop) * CELL / 2
        spare_x = max((columns.stop - columns.start) * CELL - across - 2 * PASSAGE, 0.0)
        spare_y = max((rows.stop - rows.start) * CELL - along - 2 * PASSAGE, 0.0)
        x = _snapped(middle_x - across / 2 + spare_x * generator.uniform(-0.5, 0.5))
        y = _snapped(middle_y - along / 2 + spare_y * generator.uniform(-0.5, 0.5))
        return (x, y, x + across, y + along), 0.0 if turned else math.pi / 2

    def _against_wall(
        self, room: int, width: float, depth: float, generator: np.random.Generator
    ) -> tuple[Rectangle, float, Boundary] | None:
        """Back to a wall, half of the time in a corner of it."""
        walls = [wall for wall in self._walls[room] if wall[0].length >= width + 0.2]
        if not walls:
            return None
        # Longer walls are taken more often: a point is drawn on all of them laid end to end.
        ends = list(accumulate(wall[0].length for wall in walls))
        boundary, above = walls[bisect_left(ends, generator.random() * ends[-1])]
        offset = self._half_wall + 0.02 if boundary.low >= 0 and boundary.high >= 0 else 0.02
        slack = boundary.length - width - 2 * (self._half_wall + 0.02)
        share = min(max(2.0 * generator.random() - 0.5, 0.0), 1.0)
        start = boundary.start + self._half_wall + 0.02 + slack * share
        if above:
            rectangle = boundary.rectangle(start, start + width, -offset, offset + depth)
        else:
            rectangle = boundary.rectangle(start, start + width, offset + depth, -offset)
        side = 1.0 if above else 0.0
        return rectangle, math.pi * side if boundary.vertical else math.pi * (0.5 - side), boundary

    def _is_free(self, room: int, rectangle: Rectangle, wall: Boundary | None) -> bool:
        """Whether a rectangle is free for a piece in a room.

        It is inside the room with a passage before it, off the doors, and beside or well away from
        all other pieces.
        """
        if not self._is_inside(room, _with_passage(rectangle, wall, room, self._half_wall)):
            return False
        if any(_gap(rectangle, clear) <= 0.0 for clear in self._clear.get(room, [])):
            return False
        return all(
            _gap(rectangle, other) >= (0.02 if wall is not None and wall is other_wall else PASSAGE)
            for other, other_wall in self._taken.get(room, [])
        )

    def _is_inside(self, room: int, rectangle: Rectangle) -> bool:
        x_low, y_low, x_high, y_high = rectangle
        if x_low < 0.0 or y_low < 0.0:
            return False
        rows = slice(int(y_low / CELL + 1e-6), math.ceil(y_high / CELL - 1e-6))
        columns = slice(int(x_low / CELL + 1e-6), math.ceil(x_high / CELL - 1e-6))
        if rows.stop > self._labels.shape[0] or columns.stop > self._labels.shape[1]:
            return False
        return bool((self._labels[rows, columns] == room).all())


def _snapped(value: float) -> float:
    return round(value / 0.05) * 0.05


def _with_passage(rectangle: Rectangle, wall: Boundary | None, room: int, half_wall: float) -> Rectangle:
    """Return the footprint and the passage that must lie in the room.

    The passage is before a piece at a wall, and all around a free-standing one.
    """
    x_low, y_low, x_high, y_high = rectangle
    more = PASSAGE + half_wall
    if wall is None:
        return (x_low - more, y_low - more, x_high + more, y_high + more)
    before = wall.low == room
    if wall.vertical:
        return (x_low - more, y_low, x_high, y_high) if before else (x_low, y_low, x_high + more, y_high)
    return (x_low, y_low - more, x_high, y_high) if before else (x_low, y_low, x_high, y_high + more)


def _gap(a: Rectangle, b: Rectangle) -> float:
    """Larger of the distances along x and y between two rectangles [m].

    Negative where they overlap.
    """
    return max(a[0] - b[2], b[0] - a[2], a[1] - b[3], b[1] - a[3])
