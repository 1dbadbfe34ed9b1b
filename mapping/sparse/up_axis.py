"""Whether the way up that is assumed of a cloud fits it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.sparse.floor_plane import FloorPlane, find_floor
from lidarium.mapping.sparse.settings import FloorSettings

CELL_M = 0.25
"""Side of the cells by which surfaces are measured [m]."""

LARGER = 2.0
"""How many times as large as the floor a surface along another axis is to be told."""

IN_CONE = 0.99
"""Share of the points in front of a camera by which a cloud is taken for one in its frame."""

NARROWEST = 0.25
"""Tangent of half the view of a camera, at least."""

_MAX_POINTS = 50_000
_ON_PLANE_M = 0.05


@dataclass(frozen=True, slots=True)
class FloorFound:
    """The floor of a cloud by the assumed way up.

    Attributes
    ----------
    plane : FloorPlane or None
        Its plane; None if there is none.
    area_m2, share : float
        Its area [m2], and its share of the points.
    doubt : str
        Why another way up is more likely; empty if none is.
    """

    plane: FloorPlane | None
    area_m2: float
    share: float
    doubt: str = ""


def check_up(
    points: NDArray[np.floating], up: tuple[float, float, float], seed: int = 0, least_share: float = 0.03
) -> FloorFound:
    """Find the floor of a cloud (N, 3) [m] by its way up, and compare it with level surfaces along other axes."""
    some = np.asarray(points, np.float64)
    if len(some) > _MAX_POINTS:
        some = some[np.random.default_rng(seed).choice(len(some), _MAX_POINTS, replace=False)]
    plane, area = _level_surface(some, up, seed, least_share)
    share = 0.0 if plane is None else float((np.abs(plane.heights(some)) <= _ON_PLANE_M).mean())
    given = np.array(up) / np.linalg.norm(up)
    if given[2] > 0.9 and _is_in_camera_frame(some):
        doubt = "all points lie in front of the origin along z, as in a camera's frame: --levels --up 0,-1,0?"
        return FloorFound(plane, area, share, doubt)
    others = {}
    for axis in (*np.eye(3), *-np.eye(3)):
        # A ceiling is no floor, though it is level.
        if abs(axis @ given) < 0.5:
            word = ",".join(f"{value:g}" for value in axis + 0.0)
            others[word] = _level_surface(some, (axis[0], axis[1], axis[2]), seed)[1]
    word = max(others, key=lambda each: others[each])
    doubt = ""
    if others[word] >= LARGER * max(area, CELL_M**2):
        doubt = f"the largest level surface, {others[word]:.1f} m2, lies along another axis: --levels --up {word}?"
    return FloorFound(plane, area, share, doubt)


def _is_in_camera_frame(points: NDArray[np.float64]) -> bool:
    """Return whether points are those that a camera in the origin sees along z: within its view, and filling it."""
    depths, aside = points[:, 2], np.abs(points[:, :2]).max(axis=1)
    is_ahead = (depths > 0.0) & (aside < depths)
    if is_ahead.mean() < IN_CONE:
        return False
    return bool(np.percentile(aside[is_ahead] / depths[is_ahead], 95.0) >= NARROWEST)


def _level_surface(
    points: NDArray[np.float64], up: tuple[float, float, float], seed: int, least_share: float = 0.03
) -> tuple[FloorPlane | None, float]:
    """Return the plane of the floor by a way up, and its area [m2]."""
    try:
        settings = FloorSettings(up_x=up[0], up_y=up[1], up_z=up[2], least_share=least_share)
        plane = find_floor(points, settings, seed)
    except ValueError:
        return None, 0.0
    on_plane = points[np.abs(plane.heights(points)) <= _ON_PLANE_M]
    cells = np.floor((on_plane @ plane.levelling()[:3, :3].T)[:, :2] / CELL_M)
    return plane, float(len(np.unique(cells, axis=0))) * CELL_M**2
