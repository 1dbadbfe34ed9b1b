"""Faces drawn into inverse depths, scan line by scan line, exact at pixel centres.

Over the pixels of an image the inverse depth of a plane is linear. So is the product of a pixel's ray with
the normal of the plane through the camera and an edge of a face. The part of a scan line that a face covers is
therefore an interval whose ends are linear in the row; nothing needs to be clipped in front of the camera.

References
----------
M. Olano and T. Greer, "Triangle scan conversion using 2D homogeneous coordinates", Graphics Hardware 1997.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.faces import LINES, OVERLAP, PIXELS, WORD, bound_columns, raise_pixels
from lidarium.mapping.kernels.views import scratch_grid

FOCAL, CENTRE_COLUMN, CENTRE_ROW, DEPTH_MIN, DEPTH_MAX, COLUMNS, ROWS = range(7)
"""Places in the numbers of a view."""

CORNERS = 4
NEAR = 1e-3
"""Depth of the plane at which the rows of a face are bounded [m]."""

LEVEL = 1e-12
"""An edge whose line hardly changes along a row bounds rows, not columns."""


class FaceArrays(NamedTuple):
    """The faces that a camera may see, as ``envs.floors.faces.Faces`` has them.

    Attributes
    ----------
    corners : (faces, 4, 3) float64
        Corners [m].
    planes : (faces, 4) float64
        Unit normals and offsets.
    spheres : (faces, 4) float64
        Centres and radii [m].
    """

    corners: Annotated[Array, np.float64, 3]
    planes: Annotated[Array, np.float64, 2]
    spheres: Annotated[Array, np.float64, 2]


class Span(NamedTuple):
    """Pixels that a face covers: scratch of one face.

    Attributes
    ----------
    camera_corners : (4, 3) float64
        Corners in the optical frame [m].
    edges : (2, 4, 2) float64
        Lines that bound the columns from below and from above: column at row 0, and its change a row.
    columns : (2, rows + padding) int32
        First and last column of each row with its centre in the face; empty if the first is greater.
    """

    camera_corners: Array
    edges: Array
    columns: Array


@kernel
def new_span(rows: int) -> Span:
    """Return scratch for the faces of an image."""
    padded = (rows + LINES - 1) // LINES * LINES
    return Span(np.empty((CORNERS, 3)), np.empty((2, CORNERS, 2)), np.empty((2, padded), np.int32))


@kernel(nrt=False)
def is_in_view(faces: FaceArrays, face: int, axes: Array, eye: Array, view: Array, sides: Array) -> bool:
    """Whether a face looks at the camera and its sphere is in the camera's view.

    ``axes`` (3, 3) are the optical axes in the world, ``eye`` (3,) is the optical centre [m]. ``sides`` (4, 3) are
    the inward normals of the four planes around the view, in the world.
    """
    plane, sphere = faces.planes[face], faces.spheres[face]
    if plane[0] * eye[0] + plane[1] * eye[1] + plane[2] * eye[2] - plane[3] <= 0.0:
        return False
    x, y, z, radius = sphere[0] - eye[0], sphere[1] - eye[1], sphere[2] - eye[2], sphere[3]
    along = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z
    if along + radius <= 0.0 or along - radius > view[DEPTH_MAX]:
        return False
    for side in sides:
        if side[0] * x + side[1] * y + side[2] * z < -radius:
            return False
    return True


@kernel(nrt=False)
def view_sides(axes: Array, view: Array, sides: Array) -> None:
    """Write the inward unit normals of the planes around a view into ``sides`` (4, 3), in the world."""
    left, right = -0.5 - view[CENTRE_COLUMN], view[COLUMNS] - 0.5 - view[CENTRE_COLUMN]
    top, bottom = -0.5 - view[CENTRE_ROW], view[ROWS] - 0.5 - view[CENTRE_ROW]
    focal = view[FOCAL]
    for k in range(3):
        sides[0, k] = (focal * axes[0, k] - left * axes[2, k]) / math.hypot(focal, left)
        sides[1, k] = (right * axes[2, k] - focal * axes[0, k]) / math.hypot(focal, right)
        sides[2, k] = (focal * axes[1, k] - top * axes[2, k]) / math.hypot(focal, top)
        sides[3, k] = (bottom * axes[2, k] - focal * axes[1, k]) / math.hypot(focal, bottom)


@kernel(nrt=False)
def _rows_of(corners: Array, view: Array) -> tuple[int, int]:
    """Return the first and the last row that a face of corners in the optical frame may cover."""
    low, high = math.inf, -math.inf
    for k in range(CORNERS):
        y, z = corners[k, 1], corners[k, 2]
        if z >= NEAR:
            low, high = min(low, y / z), max(high, y / z)
        after = (k + 1) % CORNERS
        next_y, next_z = corners[after, 1], corners[after, 2]
        if (z - NEAR) * (next_z - NEAR) < 0.0:
            share = (NEAR - z) / (next_z - z)
            crossing = (y + share * (next_y - y)) / NEAR
            low, high = min(low, crossing), max(high, crossing)
    first = view[CENTRE_ROW] + view[FOCAL] * low - OVERLAP
    last = view[CENTRE_ROW] + view[FOCAL] * high + OVERLAP
    if not (first <= view[ROWS] - 1.0 and last >= 0.0):
        return 1, 0
    return int(math.ceil(max(first, 0.0))), int(math.floor(min(last, view[ROWS] - 1.0)))


@kernel(forceinline=True, nrt=False)
def sides_beyond(x: float, y: float, z: float, view: Array) -> int:
    """Return which planes of the view frustum a point in the optical frame is outside of, as bits.

    A body whose corners are all outside of the same plane is not in the image.
    """
    focal = view[FOCAL]
    return (
        (1 if focal * x < (-0.5 - view[CENTRE_COLUMN]) * z else 0)
        | (2 if focal * x > (view[COLUMNS] - 0.5 - view[CENTRE_COLUMN]) * z else 0)
        | (4 if focal * y < (-0.5 - view[CENTRE_ROW]) * z else 0)
        | (8 if focal * y > (view[ROWS] - 0.5 - view[CENTRE_ROW]) * z else 0)
        | (16 if z <= 0.0 else 0)
        | (32 if z > view[DEPTH_MAX] else 0)
    )


@kernel(nrt=False)
def _outline(corners: Array, axes: Array, eye: Array, view: Array, span: Span) -> tuple[int, int]:
    """Find the edges of a face in an image; return the first and the last row that it may cover."""
    places, lows, highs = span.camera_corners, span.edges[0], span.edges[1]
    beyond = 63
    for k in range(CORNERS):
        x, y, z = corners[k, 0] - eye[0], corners[k, 1] - eye[1], corners[k, 2] - eye[2]
        for axis in range(3):
            places[k, axis] = axes[axis, 0] * x + axes[axis, 1] * y + axes[axis, 2] * z
        beyond &= sides_beyond(places[k, 0], places[k, 1], places[k, 2], view)
    if beyond:
        return 1, 0
    first, last = _rows_of(places, view)
    scale = 1.0 / view[FOCAL]
    for k in range(CORNERS):
        a, b = places[k], places[(k + 1) % CORNERS]
        along = (a[1] * b[2] - a[2] * b[1]) * scale
        across = (a[2] * b[0] - a[0] * b[2]) * scale
        ahead = a[0] * b[1] - a[1] * b[0]
        lows[k, 0], lows[k, 1], highs[k, 0], highs[k, 1] = -0.5, 0.0, view[COLUMNS] - 0.5, 0.0
        # The edge bounds columns u with along * (u - cx) + across * (v - cy) + ahead <= 0.
        if abs(along) > LEVEL * (abs(across) + abs(ahead)):
            inverse = 1.0 / along
            slope = -across * inverse
            start = view[CENTRE_COLUMN] - ahead * inverse - slope * view[CENTRE_ROW]
            edge = highs[k] if along > 0.0 else lows[k]
            edge[0], edge[1] = start, slope
        elif abs(across) > 0.0:
            bound = view[CENTRE_ROW] - ahead / across
            if across > 0.0:
                last = min(last, int(math.floor(min(bound + OVERLAP, view[ROWS]))))
            else:
                first = max(first, int(math.ceil(max(bound - OVERLAP, 0.0))))
    return first, last


@kernel(nrt=False)
def cover(corners: Array, axes: Array, eye: Array, view: Array, span: Span) -> tuple[int, int]:
    """Find the columns that a face covers on each row of an image; return its first and last row.

    Parameters
    ----------
    corners : (4, 3) float64
        Corners in the world [m].
    axes, eye : (3, 3), (3,) float64
        Optical axes and centre in the world.
    view : (7,) float64
        Numbers of the view.
    """
    first, last = _outline(corners, axes, eye, view, span)
    if first > last:
        return first, last
    begins, ends = span.columns[0].ctypes.data, span.columns[1].ctypes.data
    for row in range(first & -LINES, last + 1, LINES):
        offset = WORD * row
        bound_columns(span.edges.ctypes.data, float(row), view[COLUMNS], begins + offset, ends + offset)
    return first, last


@kernel(nrt=False)
def inverse_plane(plane: Array, axes: Array, eye: Array, view: Array) -> tuple[float, float, float]:
    """Return the inverse depth of a plane at pixel (0, 0) and its change a column and a row [1/m]."""
    distance = plane[0] * eye[0] + plane[1] * eye[1] + plane[2] * eye[2] - plane[3]
    scale = -1.0 / distance
    x = (plane[0] * axes[0, 0] + plane[1] * axes[0, 1] + plane[2] * axes[0, 2]) * scale / view[FOCAL]
    y = (plane[0] * axes[1, 0] + plane[1] * axes[1, 1] + plane[2] * axes[1, 2]) * scale / view[FOCAL]
    z = (plane[0] * axes[2, 0] + plane[1] * axes[2, 1] + plane[2] * axes[2, 2]) * scale
    return z - x * view[CENTRE_COLUMN] - y * view[CENTRE_ROW], x, y


@kernel(nrt=False)
def draw_faces(faces: FaceArrays, axes: Array, eye: Array, view: Array, span: Span, inverse: Array) -> None:
    """Draw the faces in view into inverse depths.

    Parameters
    ----------
    inverse : (rows, columns + padding) float32
        Greatest inverse depths so far; raised [1/m]. Its columns are a multiple of ``PIXELS``.
    """
    sides = scratch_grid(4, 3, np.float64)
    view_sides(axes, view, sides)
    width, pixels = inverse.shape[1], inverse.ctypes.data
    begins, ends = span.columns[0], span.columns[1]
    for face in range(faces.planes.shape[0]):
        if not is_in_view(faces, face, axes, eye, view, sides):
            continue
        first, last = cover(faces.corners[face], axes, eye, view, span)
        start, along, across = inverse_plane(faces.planes[face], axes, eye, view)
        slope = np.float32(along)
        for row in range(first, last + 1):
            left, right = int(begins[row]), int(ends[row])
            # Rounded once a block: the inverse depth at a block's first column.
            base, address = start + across * row, pixels + 4 * row * width
            for column in range(left & -PIXELS, right + 1, PIXELS):
                raise_pixels(
                    address + 4 * column,
                    np.float32(base + along * column),
                    slope,
                    left - column,
                    right - column,
                )
