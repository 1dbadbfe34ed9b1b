"""Flat-shaded pictures of faces and bodies, from any place."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import Colour, Frame
from lidarium.envs.floors.faces import CEILING, GROUND, SECTION, SURROUNDINGS, Faces
from lidarium.envs.simulation.depth.body_drawing import draw_body
from lidarium.envs.simulation.depth.face_drawing import (
    CENTRE_COLUMN,
    CENTRE_ROW,
    COLUMNS,
    FOCAL,
    ROWS,
    FaceArrays,
    Span,
    cover,
    inverse_plane,
    is_in_view,
    new_span,
    view_sides,
)
from lidarium.mapping.kernels.compilation import Array, kernel

FAR = 200.0
"""Farthest that a picture shows [m]."""

NOTHING = -1
"""Number of a pixel that shows nothing."""

TOP_M = 0.01
"""Upper part of a body that is drawn as its top [m]."""

_SIDE_BRIGHTNESS = 0.78
_LIGHT = np.array([0.36, 0.48, 0.8])
_BACKGROUND = (244, 246, 249)
_COLOURS = {
    GROUND: (231, 226, 216),
    CEILING: (250, 250, 250),
    SURROUNDINGS: (214, 216, 222),
    SECTION: (60, 66, 80),
}
_FURNITURE = np.array([(201, 164, 120), (180, 150, 128), (160, 172, 160), (172, 160, 182), (190, 176, 140)])
_WALL = (214, 216, 222)


@dataclass(frozen=True, slots=True, eq=False)
class Viewpoint:
    """From if a picture is taken.

    Attributes
    ----------
    eye : (3,) float64
        Position of the eye [m].
    axes : (3, 3) float64
        Directions to the right, down and ahead.
    field_of_view : float
        Horizontal angle that the picture covers [rad].
    """

    eye: NDArray[np.float64]
    axes: NDArray[np.float64]
    field_of_view: float

    @classmethod
    def towards(cls, eye: NDArray[np.float64], target: NDArray[np.float64], field_of_view: float) -> "Viewpoint":
        """Return the viewpoint that sees a target (3,) [m] in the middle of its picture."""
        ahead = (target - eye) / np.linalg.norm(target - eye)
        upward = np.array((0.0, 0.0, 1.0) if abs(ahead[2]) < 0.999 else (0.0, 1.0, 0.0))
        right = np.cross(ahead, upward)
        right /= np.linalg.norm(right)
        return cls(np.asarray(eye, np.float64), np.stack([right, np.cross(ahead, right), ahead]), field_of_view)


@kernel
def _number_faces(
    faces: FaceArrays, axes: Array, eye: Array, view: Array, span: Span, inverse: Array, numbers: Array
) -> None:
    """Draw faces into inverse depths, and the number of the nearest face into ``numbers``."""
    sides = np.empty((4, 3))
    view_sides(axes, view, sides)
    for face in range(faces.planes.shape[0]):
        if not is_in_view(faces, face, axes, eye, view, sides):
            continue
        first, last = cover(faces.corners[face], axes, eye, view, span)
        start, along, across = inverse_plane(faces.planes[face], axes, eye, view)
        for row in range(first, last + 1):
            for column in range(span.columns[0, row], span.columns[1, row] + 1):
                value = np.float32(start + across * row + along * column)
                if value > inverse[row, column]:
                    inverse[row, column], numbers[row, column] = value, face


@kernel
def _number_body(
    centre: Array,
    size: Array,
    axes: Array,
    eye: Array,
    view: Array,
    inverse: Array,
    numbers: Array,
    number: int,
) -> None:
    """Draw a body into inverse depths, and its number if it is the nearest.

    The next number is that of its top.
    """
    before = inverse.copy()
    draw_body(centre, size[0], size[1], axes, eye, view, inverse)
    for row in range(inverse.shape[0]):
        for column in range(inverse.shape[1]):
            if inverse[row, column] > before[row, column]:
                across = (column - view[CENTRE_COLUMN]) / view[FOCAL]
                down = (row - view[CENTRE_ROW]) / view[FOCAL]
                up = axes[0, 2] * across + axes[1, 2] * down + axes[2, 2]
                is_top = eye[2] + up / inverse[row, column] > centre[2] + size[1] - TOP_M
                numbers[row, column] = number + (1 if is_top else 0)


def _view_of_size(viewpoint: Viewpoint, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the numbers of a picture of that many rows and columns, as drawing kernels take them."""
    rows, columns = size
    view = np.array([0.0, 0.5 * (columns - 1), 0.5 * (rows - 1), 0.0, FAR, columns, rows])
    view[FOCAL] = 0.5 * columns / math.tan(0.5 * viewpoint.field_of_view)
    assert view[COLUMNS] == columns
    assert view[ROWS] == rows
    return view


def shade(
    faces: Faces,
    viewpoint: Viewpoint,
    size: tuple[int, int],
    bodies: NDArray[np.float64],
    colours: list[Colour],
    walls: NDArray[np.bool_] | NDArray[np.float64],
) -> Frame:
    """Draw faces and bodies in flat colours.

    Parameters
    ----------
    size : (rows, columns)
        Size of the picture [pixels].
    bodies : (N, 5) float64
        x, y, height of the base, radius and height of upright cylinders [m].
    walls : (solids,) bool or (solids, 3) float64
        Which solids are walls, the others being furniture; or the colour of each.

    Returns
    -------
    (rows, columns, 3) uint8
        The picture.
    """
    view = _view_of_size(viewpoint, size)
    inverse, numbers = np.full(size, 1.0 / FAR, np.float32), np.full(size, NOTHING, np.int64)
    arrays = FaceArrays(faces.corners, faces.planes, faces.spheres)
    _number_faces(arrays, viewpoint.axes, viewpoint.eye, view, new_span(size[0]), inverse, numbers)
    for number, body in enumerate(bodies):
        _number_body(
            np.ascontiguousarray(body[:3]),
            np.ascontiguousarray(body[3:]),
            viewpoint.axes,
            viewpoint.eye,
            view,
            inverse,
            numbers,
            len(faces) + 2 * number,
        )
    sides_and_tops = [[share * part for part in colour] for colour in colours for share in (_SIDE_BRIGHTNESS, 1.0)]
    palette = np.concatenate([_face_colours(faces, walls), np.array(sides_and_tops).reshape(-1, 3), [_BACKGROUND]])
    return np.asarray(_with_edges(palette[numbers], numbers), np.uint8)


def _face_colours(faces: Faces, walls: NDArray[np.bool_] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the colour of each face (faces, 3): the colour of its owner, lit from above on one side."""
    light = _LIGHT / np.linalg.norm(_LIGHT)
    brightness = 0.72 + 0.28 * np.abs(faces.planes[:, :3] @ light)
    brightness[faces.owners < 0] = np.where(faces.owners[faces.owners < 0] == SURROUNDINGS, 0.9, 1.0)
    return np.asarray(owner_colours(faces, walls) * brightness[:, None], np.float64)


def owner_colours(faces: Faces, walls: NDArray[np.bool_] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the colour of the owner of each face, (faces, 3).

    ``walls`` is which solids are walls, (solids,), or the colours of the solids, (solids, 3).
    """
    furniture: NDArray[np.float64] = np.asarray(walls, np.float64)
    if walls.ndim == 1:
        furniture = np.where(walls[:, None], _WALL, _FURNITURE[np.arange(len(walls)) % len(_FURNITURE)])
    special = np.array([_COLOURS[owner] for owner in sorted(_COLOURS)])
    # Owners below 0 count from the end.
    return np.asarray(np.concatenate([furniture, special])[faces.owners], np.float64)


def _with_edges(picture: NDArray[np.float64], numbers: NDArray[np.int64]) -> NDArray[np.float64]:
    """Darken pixels at the borders between faces."""
    is_edge = np.zeros(numbers.shape, np.bool_)
    is_edge[:, 1:] |= numbers[:, 1:] != numbers[:, :-1]
    is_edge[1:] |= numbers[1:] != numbers[:-1]
    return np.where(is_edge[:, :, None], 0.86 * picture, picture)
