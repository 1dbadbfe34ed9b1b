"""The plane of the floor, and its search in a cloud."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.sparse.settings import FloorSettings


@dataclass(frozen=True, slots=True)
class FloorPlane:
    """A plane by its upward normal.

    Attributes
    ----------
    x, y, z : float
        Unit normal, to the side of free space.
    offset : float
        Height of the origin above the plane [m].
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        numbers = (self.x, self.y, self.z, self.offset)
        length = math.hypot(self.x, self.y, self.z)
        if not (all(map(math.isfinite, numbers)) and abs(length - 1.0) < 1e-6):
            raise ValueError(f"the floor is {numbers}; want a unit normal with the height of the origin above it")

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit normal, shape (3,)."""
        return np.array([self.x, self.y, self.z])

    @property
    def tilt(self) -> float:
        """Angle between the normal and the z axis [rad]."""
        return math.atan2(math.hypot(self.x, self.y), self.z)

    def heights(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the heights of points (..., 3) above the plane [m], shape (...)."""
        return np.asarray(points @ self.normal + self.offset)

    def levelling(self) -> NDArray[np.float64]:
        """Return the rigid motion (4, 4) by the least turn that makes the plane z = 0."""
        axis = np.array([self.y, -self.x, 0.0])
        cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
        motion = np.eye(4)
        if self.z > -1.0 + 1e-9:
            motion[:3, :3] += cross + cross @ cross / (1.0 + self.z)
        else:
            motion[1, 1] = motion[2, 2] = -1.0
        motion[2, 3] = self.offset
        return motion


_MAX_POINTS = 4000
_REFINEMENTS = 4
_BLOCK = 64
_BANDS = 50
_BELOW_SHARE = 0.25


def find_floor(points: NDArray[np.float64], settings: FloorSettings | None = None, seed: int = 0) -> FloorPlane:
    """Find the plane of the floor.

    Parameters
    ----------
    points : (N, 3) float64
        A cloud, spread evenly: means of voxels [m].
    """
    settings = settings or FloorSettings()
    up = np.array([settings.up_x, settings.up_y, settings.up_z], np.float64)
    up /= np.linalg.norm(up)
    rng = np.random.default_rng(seed)
    some = points if len(points) <= _MAX_POINTS else points[rng.choice(len(points), _MAX_POINTS, replace=False)]
    least = max(settings.least_share, 3.0 / max(len(some), 3))
    best, share = _best_plane(some, up, settings, rng)
    if share < least:
        # Stairs that lead down have points below the floor, but fewer than the floor.
        best, share = _best_plane(some, up, settings, rng, _BELOW_SHARE)
    if best is None or share < least:
        raise ValueError(
            f"no floor: the best plane within {math.degrees(settings.most_tilt):.3g} degrees of level has "
            f"{share:.1%} of {len(points):,} points; want {settings.least_share:.1%}, "
            "another way up, a smaller share (--floor-share), or a floor that is given"
        )
    return _refined(points, best, up, settings.distance_m)


def _best_plane(
    points: NDArray[np.float64],
    up: NDArray[np.float64],
    settings: FloorSettings,
    rng: np.random.Generator,
    below_share: float = 0.0,
) -> tuple[FloorPlane | None, float]:
    """Return the drawn plane with the most points, and its share of them.

    Below it are at most ``settings.most_below`` of all points, or ``below_share`` times as many as on it.
    """
    if len(points) < 3:
        return None, 0.0
    corners = points[_drawn(points @ up, settings.trials, rng)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    is_plane = lengths > 1e-9
    normals, corners = normals[is_plane] / lengths[is_plane, None], corners[is_plane, 0]
    normals *= np.where(normals @ up < 0.0, -1.0, 1.0)[:, None]
    is_level = normals @ up >= math.cos(settings.most_tilt)
    normals, corners = normals[is_level], corners[is_level]
    offsets = -np.einsum("ij,ij->i", normals, corners)
    best, maximum = None, 0.0
    for start in range(0, len(normals), _BLOCK):
        part = slice(start, start + _BLOCK)
        heights = points @ normals[part].T + offsets[part]
        shares = (np.abs(heights) <= settings.distance_m).mean(axis=0)
        below = (heights < -2.0 * settings.distance_m).mean(axis=0)
        shares[below > np.maximum(settings.most_below, below_share * shares)] = 0.0
        place = int(np.argmax(shares))
        if shares[place] > maximum:
            best, maximum = _plane(normals[start + place], offsets[start + place]), float(shares[place])
    return best, maximum


def _drawn(heights: NDArray[np.float64], trials: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Draw three points a trial, (trials, 3), for every other one of about one height.

    If little of a cloud is floor, three points of any height are hardly ever all on it.
    """
    count = len(heights)
    places = rng.integers(0, count, (trials, 3))
    reach = max(count // _BANDS, 1)
    near = places[::2, :1] + rng.integers(-reach, reach + 1, (len(places[::2]), 2))
    places[::2, 1:] = np.clip(near, 0, count - 1)
    places[::2] = np.argsort(heights, kind="stable")[places[::2]]
    return places


def _refined(points: NDArray[np.float64], plane: FloorPlane, up: NDArray[np.float64], distance: float) -> FloorPlane:
    """Return the plane of least squares through the points on a plane."""
    for _ in range(_REFINEMENTS):
        near = points[np.abs(plane.heights(points)) <= distance]
        if len(near) < 3:
            break
        middle = near.mean(axis=0)
        values, vectors = np.linalg.eigh(np.cov((near - middle).T))
        normal = vectors[:, 0] * (1.0 if vectors[:, 0] @ up >= 0.0 else -1.0)
        if values[1] < 1e-9 or normal @ plane.normal < 0.9:
            break
        plane = _plane(normal, -float(normal @ middle))
    return plane


def _plane(normal: NDArray[np.float64], offset: float) -> FloorPlane:
    x, y, z = (normal / np.linalg.norm(normal)).tolist()
    return FloorPlane(x, y, z, float(offset))
