"""Faces of a floor that a camera sees: walls, furniture, ground and ceiling.

A face is convex and has four corners; a triangle repeats one. Seen from the outside, its corners run
counter-clockwise. Solids are prisms, so that their faces are sides, tops and undersides; bent outlines and
holes are cut into trapezoids. Faces on the ground or at the ceiling are left out: they are never visible.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.raster import Raster, rectangles_of

GROUND, CEILING, SURROUNDINGS, SECTION = -1, -2, -3, -4
"""Numbers of faces that belong to no solid.

They are the ground, the ceiling, all outside of the bounds with the walls of images, and cuts of sections.
"""

Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Faces:
    """Convex faces, each of four corners.

    Attributes
    ----------
    corners : (faces, 4, 3) float64
        x, y, z [m], counter-clockwise seen from the outside.
    planes : (faces, 4) float64
        Unit normal that points to the outside, and its product with any point of the face [1, m].
    spheres : (faces, 4) float64
        Centre and radius of a sphere around each face [m].
    owners : (faces,) int32
        Number of the solid that has the face; ``GROUND``, ``CEILING`` or ``SURROUNDINGS``.
    """

    corners: Points
    planes: Points
    spheres: Points
    owners: NDArray[np.int32]

    @classmethod
    def of_corners(cls, corners: Points, owners: NDArray[np.int32]) -> "Faces":
        """Return faces of their corners (faces, 4, 3) [m]; those without area are dropped."""
        # The cross product of the diagonals is twice the area along the normal, triangles included.
        normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        areas = np.linalg.norm(normals, axis=1)
        has_area = areas > 1e-9
        corners, owners = corners[has_area], owners[has_area]
        normals = normals[has_area] / areas[has_area, None]
        centres = corners.mean(axis=1)
        offsets = np.einsum("ij,ij->i", normals, centres)
        radii = np.linalg.norm(corners - centres[:, None], axis=2).max(axis=1) if len(corners) else np.zeros(0)
        return cls(
            np.ascontiguousarray(corners),
            np.ascontiguousarray(np.column_stack([normals, offsets])),
            np.ascontiguousarray(np.column_stack([centres, radii])),
            np.ascontiguousarray(owners, np.int32),
        )

    def __len__(self) -> int:
        return len(self.corners)


def faces_of(floor: Floor) -> Faces:
    """Return all faces of a floor."""
    x_min, y_min, x_max, y_max = floor.bounds
    rectangle = np.array([(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)])
    parts = [
        (GROUND, _level(rectangle, 0.0)[None]),
        (CEILING, _level(rectangle[::-1], floor.ceiling)[None]),
        (SURROUNDINGS, _sides(rectangle[::-1], 0.0, floor.ceiling)),
    ]
    if floor.cells is not None:
        parts.append((SURROUNDINGS, _cell_sides(floor.cells, floor.ceiling)))
    parts += [(number, _prism(solid, floor.ceiling)) for number, solid in enumerate(floor.solids)]
    return _joined(parts)


def section_of(floor: Floor, height: float) -> Faces:
    """Return the faces of a floor below a height, to be seen from above.

    Parameters
    ----------
    height : float
        Height of the cut [m]; higher solids get a top there, owned by ``SECTION``.
    """
    x_min, y_min, x_max, y_max = floor.bounds
    rectangle = np.array([(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)])
    parts = [(GROUND, _level(rectangle, 0.0)[None])]
    if floor.cells is not None:
        parts.append((SURROUNDINGS, _cell_sides(floor.cells, height)))
        (x, y), size = floor.cells.origin, floor.cells.resolution
        low_row, low_column, high_row, high_column = rectangles_of(floor.cells.solid != 0).T
        corners = [
            (low_column, low_row),
            (high_column, low_row),
            (high_column, high_row),
            (low_column, high_row),
        ]
        tops = np.empty((len(low_row), 4, 3))
        for corner, (column, row) in enumerate(corners):
            tops[:, corner, 0], tops[:, corner, 1] = x + size * column, y + size * row
        tops[:, :, 2] = height
        parts.append((SECTION, tops))
    for number, solid in enumerate(floor.solids):
        faces = _prism(replace(solid, z_high=min(solid.z_high, floor.ceiling)), height)
        parts.append((number, faces))
        if max(solid.z_low, 0.0) < height <= min(solid.z_high, floor.ceiling):
            quads = [_level(quad, height) for part in convex_parts(solid) for quad in _quads(part)]
            parts.append((SECTION, np.array(quads)))
    return _joined(parts)


def _joined(parts: list[tuple[int, Points]]) -> Faces:
    """Return the faces of parts, each with its owner."""
    owners = np.concatenate([np.full(len(corners), owner, np.int32) for owner, corners in parts])
    return Faces.of_corners(np.concatenate([corners for _, corners in parts]), owners)


def convex_parts(solid: Solid) -> list[Points]:
    """Return the outline of a solid, less its holes, as convex polygons.

    Returns
    -------
    list of (3 or more, 2) float64
        Corners, counter-clockwise [m]: the outline itself if it is convex, otherwise trapezoids.
    """
    ring = _counter_clockwise(solid.polygon)
    if not solid.holes and _is_convex(ring):
        return [ring]
    return _trapezoids(solid.edges)


def _prism(solid: Solid, ceiling: float) -> Points:
    """Return the faces of a solid, (faces, 4, 3) [m]."""
    low, high = max(solid.z_low, 0.0), min(solid.z_high, ceiling)
    if low >= high:
        return np.zeros((0, 4, 3))
    rings = [_counter_clockwise(solid.polygon), *(_counter_clockwise(hole)[::-1] for hole in solid.holes)]
    faces = [_sides(ring, low, high) for ring in rings]
    if high < ceiling or low > 0.0:
        for part in convex_parts(solid):
            faces += [_level(quad, high)[None] for quad in _quads(part) if high < ceiling]
            faces += [_level(quad[::-1], low)[None] for quad in _quads(part) if low > 0.0]
    return np.concatenate(faces)


def _sides(ring: Points, low: float, high: float) -> Points:
    """Return upright faces along a ring whose outside is on the right, (edges, 4, 3)."""
    after = np.roll(ring, -1, axis=0)
    faces = np.empty((len(ring), 4, 3))
    faces[:, 0, :2], faces[:, 1, :2], faces[:, 2, :2], faces[:, 3, :2] = ring, after, after, ring
    faces[:, :2, 2], faces[:, 2:, 2] = low, high
    return faces


def _level(quad: Points, height: float) -> Points:
    """Return a level face at a height, (4, 3)."""
    return np.column_stack([quad, np.full(4, height)])


def _quads(polygon: Points) -> list[Points]:
    """Cut a convex polygon into pieces of four corners, the last of which may repeat one."""
    quads = []
    for k in range(1, len(polygon) - 1, 2):
        last = min(k + 2, len(polygon) - 1)
        quads.append(polygon[[0, k, k + 1, last]])
    return quads


def _counter_clockwise(ring: Points) -> Points:
    x, y = (ring - ring[0]).T
    return ring if np.dot(x, np.roll(y, -1)) >= np.dot(y, np.roll(x, -1)) else ring[::-1]


def _is_convex(ring: Points) -> bool:
    edges = np.roll(ring, -1, axis=0) - ring
    after = np.roll(edges, -1, axis=0)
    turns = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]
    # A ring that winds twice turns left all along, too.
    total = np.arctan2(turns, (edges * after).sum(axis=1)).sum()
    return bool((turns >= -1e-12).all()) and abs(total - 2.0 * np.pi) < 1e-6


def _trapezoids(edges: Points) -> list[Points]:
    """Cut the inside of closed rings by the even-odd rule into trapezoids with level bases.

    Parameters
    ----------
    edges : (E, 4) float64
        x1, y1, x2, y2 of all rings [m].

    Returns
    -------
    list of (3 or 4, 2) float64
        Corners, counter-clockwise [m].
    """
    upward = np.where((edges[:, 1] <= edges[:, 3])[:, None], edges, edges[:, [2, 3, 0, 1]])
    upward = upward[upward[:, 1] < upward[:, 3]]
    levels = np.unique(upward[:, [1, 3]])
    begun: dict[tuple[int, int], float] = {}
    parts: list[Points] = []
    for low, high in pairwise([*levels.tolist(), float("inf")]):
        middle = (low + high) / 2.0 if high < float("inf") else low
        crossing = np.flatnonzero((upward[:, 1] <= low) & (upward[:, 3] >= high))
        order = np.argsort(_x_at(upward[crossing], middle), kind="stable")
        pairs = crossing[order][: len(crossing) // 2 * 2].reshape(-1, 2).tolist()
        # A trapezoid continues while the same two edges bound it.
        here = {(left, right): begun.pop((left, right), low) for left, right in pairs}
        parts += [_trapezoid(upward[left], upward[right], base, low) for (left, right), base in begun.items()]
        begun = here
    return [part for part in parts if len(part) >= 3]


def _trapezoid(left: Points, right: Points, low: float, high: float) -> Points:
    corners = [
        (_x_at(left[None], low)[0], low),
        (_x_at(right[None], low)[0], low),
        (_x_at(right[None], high)[0], high),
        (_x_at(left[None], high)[0], high),
    ]
    return np.array([corner for k, corner in enumerate(corners) if corner != corners[k - 1]])


def _x_at(edges: Points, y: float) -> Points:
    """Return x of edges (E, 4) at a height y; their ends exactly."""
    x1, y1, x2, y2 = edges.T
    between = x1 + (y - y1) / (y2 - y1) * (x2 - x1)
    return np.asarray(np.where(y == y1, x1, np.where(y == y2, x2, between)))


def _cell_sides(cells: Raster, ceiling: float) -> Points:
    """Return upright faces between free and solid cells of an image, in long runs."""
    solid = np.pad(cells.solid != 0, 1, constant_values=True).astype(np.int8)
    (x, y), size = cells.origin, cells.resolution
    faces = []
    for is_upright in (True, False):
        grid = solid if is_upright else solid.T
        change = np.diff(grid, axis=1)[1:-1]
        before = np.pad(change, ((1, 0), (0, 0)))[:-1]
        after = np.pad(change, ((0, 1), (0, 0)))[1:]
        # Runs are found line by line: both lists have the same order.
        line, first = np.nonzero(((change != 0) & (change != before)).T)
        _, last = np.nonzero(((change != 0) & (change != after)).T)
        place, low, high = line * size, first * size, (last + 1) * size
        is_solid_after = change.T[line, first] > 0
        start, end = np.where(is_solid_after, high, low), np.where(is_solid_after, low, high)
        if is_upright:
            runs = np.stack([place + x, start + y, place + x, end + y], axis=1)
        else:
            runs = np.stack([end + x, place + y, start + x, place + y], axis=1)
        faces.append(runs)
    return _walls(np.concatenate(faces), ceiling)


def _walls(runs: Points, ceiling: float) -> Points:
    """Return upright faces along segments (N, 4) whose outside is on the right."""
    faces = np.empty((len(runs), 4, 3))
    faces[:, 0, :2] = faces[:, 3, :2] = runs[:, :2]
    faces[:, 1, :2] = faces[:, 2, :2] = runs[:, 2:]
    faces[:, :2, 2], faces[:, 2:, 2] = 0.0, ceiling
    return faces
