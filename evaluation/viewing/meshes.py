"""Triangles of what a page shows in three dimensions: floors, bodies, scans, boxes."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import Colour
from lidarium.envs.drawing.shading import owner_colours
from lidarium.envs.floors.faces import GROUND, section_of
from lidarium.envs.floors.floor import Floor

SIDES = 28
"""Sides of a body that is drawn as a prism."""

_BOX = np.array([[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 4, 1], [1, 4, 5]])
_BOX_SIDES = np.concatenate([_BOX, [[2, 3, 7], [2, 7, 6], [0, 2, 4], [2, 6, 4], [1, 5, 3], [3, 5, 7]]])


class Mesh(NamedTuple):
    """Triangles.

    Attributes
    ----------
    vertices : (V, 3) float32
        x, y, z [m].
    triangles : (T, 3) uint32
        Places of their corners in ``vertices``, counter-clockwise seen from the outside.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.uint32]


def floor_meshes(floor: Floor, height: float) -> dict[Colour, Mesh]:
    """Return what stands on a floor, cut at a height [m], by colour; the ground is left out."""
    faces = section_of(floor, height)
    is_wall = np.array([solid.z_high >= floor.ceiling for solid in floor.solids], np.bool_)
    colours = np.rint(owner_colours(faces, is_wall)).astype(np.int64)
    stands = np.flatnonzero(faces.owners != GROUND)
    if not len(stands):
        return {}
    unique, members = np.unique(colours[stands], axis=0, return_inverse=True)
    return {
        (int(red), int(green), int(blue)): _of_quads(faces.corners[stands[members.ravel() == number]])
        for number, (red, green, blue) in enumerate(unique)
    }


def _of_quads(corners: NDArray[np.float64]) -> Mesh:
    """Return the triangles of faces of four corners (F, 4, 3), of which triangles repeat one."""
    vertices = corners.reshape(-1, 3).astype(np.float32)
    firsts = 4 * np.arange(len(corners))[:, None]
    triangles = np.concatenate([firsts + np.array(half) for half in ((0, 1, 2), (0, 2, 3))])
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    has_area = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0.0
    return Mesh(vertices, triangles[has_area].astype(np.uint32))


def body_mesh(radius: float, height: float) -> Mesh:
    """Return a round body on the ground, its middle at the origin."""
    around = circle(radius)[:-1]
    low, high = (np.column_stack([around, np.full(SIDES, z)]) for z in (0.0, height))
    k = np.arange(SIDES)
    beside = (k + 1) % SIDES
    sides = np.concatenate(
        [np.column_stack([k, beside, beside + SIDES]), np.column_stack([k, beside + SIDES, k + SIDES])]
    )
    top = np.column_stack([k + SIDES, beside + SIDES, np.full(SIDES, 2 * SIDES)])
    vertices = np.concatenate([low, high, [(0.0, 0.0, height)]])
    return Mesh(vertices.astype(np.float32), np.concatenate([sides, top]).astype(np.uint32))


def nose_mesh(radius: float, height: float) -> Mesh:
    """Return an arrow ahead, on top of a body."""
    z = height + 0.012
    corners = [(0.85, 0.0), (-0.5, 0.5), (-0.25, 0.0), (-0.5, -0.5)]
    vertices = np.array([(radius * x, radius * y, z) for x, y in corners], np.float32)
    return Mesh(vertices, np.array([(0, 1, 2), (0, 2, 3)], np.uint32))


def circle(radius: float) -> NDArray[np.float64]:
    """Return points on a circle about the origin, (SIDES + 1, 2), the last of them the first."""
    angles = 2.0 * math.pi * np.arange(SIDES + 1) / SIDES
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def fan_mesh(laser: NDArray[np.float64], ends: NDArray[np.float64]) -> Mesh:
    """Return what a scan covers: triangles from a laser (3,) to the ends of two beams (beams, 3) each [m]."""
    k = np.arange(1, len(ends))
    triangles = np.column_stack([np.zeros_like(k), k, k + 1]).astype(np.uint32)
    return Mesh(np.concatenate([laser[None], ends]).astype(np.float32), triangles)


def boxes_mesh(boxes: NDArray[np.float64]) -> Mesh:
    """Return boxes of low and high corners (B, 2, 3) [m]."""
    chosen = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    vertices = boxes[:, chosen, np.arange(3)].reshape(-1, 3)
    triangles = 8 * np.arange(len(boxes))[:, None, None] + _BOX_SIDES
    return Mesh(vertices.astype(np.float32), triangles.reshape(-1, 3).astype(np.uint32))


def segments(points: NDArray[np.float64], height: float) -> NDArray[np.float32]:
    """Return the pieces of a path (P, 2) at a height, (P - 1, 2, 3); none of fewer than two points."""
    if len(points) < 2:
        return np.zeros((0, 2, 3), np.float32)
    lifted = np.column_stack([points, np.full(len(points), height)]).astype(np.float32)
    return np.stack([lifted[:-1], lifted[1:]], axis=1)
