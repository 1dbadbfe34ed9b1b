"""A floor as what PyBullet collides with: boxes, and convex prisms for what is no box.

Everything outside of the bounds is solid: four walls stand around it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.faces import convex_parts
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.raster import Raster, rectangles_of

OUTER_WALL = 1.0
"""Thickness of the walls around the bounds [m]."""

_STRAIGHT = 1e-6
"""By how much the corners of a box may be off [m]."""


@dataclass(frozen=True, slots=True)
class Box:
    """A box that stands upright.

    Attributes
    ----------
    centre, size : (3,) of float
        Of the box [m].
    turn : float
        Direction of its first side [rad].
    """

    centre: tuple[float, float, float]
    size: tuple[float, float, float]
    turn: float = 0.0


@dataclass(frozen=True, slots=True)
class FloorShapes:
    """What stands on a floor.

    Attributes
    ----------
    boxes : list of Box
        Upright boxes.
    prisms : list of ((N, 2) float64, float, float)
        Convex outline, lower and upper end of each other piece [m].
    """

    boxes: list[Box]
    prisms: list[tuple[NDArray[np.float64], float, float]]

    @classmethod
    def of(cls, floor: Floor) -> "FloorShapes":
        """Return the shapes of a floor."""
        boxes, prisms = list(_outer_walls(floor)), []
        if floor.cells is not None:
            boxes += _cell_boxes(floor.cells, floor.ceiling)
        for solid in floor.solids:
            low, high = solid.z_low, min(solid.z_high, floor.ceiling)
            if low >= high:
                continue
            box = _box_of(solid, low, high)
            if box is not None:
                boxes.append(box)
            else:
                prisms += [(piece, low, high) for piece in convex_parts(solid)]
        return cls(boxes, prisms)

    @property
    def urdf(self) -> str:
        """The boxes as the text of a URDF file: one static link."""
        # PyBullet cuts lines of more than some kilobytes.
        shapes = "\n".join(
            f'<collision><origin xyz="{_numbers(box.centre)}" rpy="0 0 {box.turn!r}"/>'
            f'<geometry><box size="{_numbers(box.size)}"/></geometry></collision>'
            for box in self.boxes
        )
        return (
            '<robot name="floor"><link name="floor"><contact><lateral_friction value="1"/></contact>'
            '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'
            f"\n{shapes}\n</link></robot>"
        )

    @property
    def obj(self) -> str:
        """The prisms as the text of an OBJ file, an object each; empty where there are none."""
        lines, first = [], 1
        for number, (outline, low, high) in enumerate(self.prisms):
            count = len(outline)
            lines.append(f"o piece_{number}")
            lines += [f"v {x!r} {y!r} {z!r}" for z in (low, high) for x, y in outline.tolist()]
            for end in (first, first + count):
                lines += [f"f {end} {end + k} {end + k + 1}" for k in range(1, count - 1)]
            first += 2 * count
        return "\n".join(lines)


def _outer_walls(floor: Floor) -> Iterator[Box]:
    x_low, y_low, x_high, y_high = floor.bounds
    width, depth, height = x_high - x_low, y_high - y_low, floor.ceiling
    x, y, thick = 0.5 * (x_low + x_high), 0.5 * (y_low + y_high), OUTER_WALL
    for side in (x_low - 0.5 * thick, x_high + 0.5 * thick):
        yield Box((side, y, 0.5 * height), (thick, depth + 2.0 * thick, height))
    for side in (y_low - 0.5 * thick, y_high + 0.5 * thick):
        yield Box((x, side, 0.5 * height), (width, thick, height))


def _box_of(solid: Solid, low: float, high: float) -> Box | None:
    """Return the box that a solid is; None where it is none."""
    corners = solid.polygon
    if len(corners) != 4 or solid.holes:
        return None
    first, second = corners[1] - corners[0], corners[3] - corners[0]
    length, depth = math.hypot(*first), math.hypot(*second)
    fourth = np.abs(corners[0] + first + second - corners[2]).max()
    if fourth > _STRAIGHT or min(length, depth) == 0.0:
        return None
    if abs(float(first @ second)) > _STRAIGHT * max(length, depth):
        return None
    x, y = corners.mean(axis=0).tolist()
    return Box((x, y, 0.5 * (low + high)), (length, depth, high - low), math.atan2(first[1], first[0]))


def _cell_boxes(cells: Raster, height: float) -> Iterator[Box]:
    """Yield boxes that cover the solid cells of a raster."""
    side, (x, y) = cells.resolution, cells.origin
    for row, column, end_row, end_column in rectangles_of(cells.solid != 0).tolist():
        centre = (x + 0.5 * side * (column + end_column), y + 0.5 * side * (row + end_row), 0.5 * height)
        yield Box(centre, (side * (end_column - column), side * (end_row - row), height))


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(map(repr, values))
