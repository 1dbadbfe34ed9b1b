"""Floors: the solids of a building, in metres, and its rasters.

A floor is a set of solids (vertical prisms) or, if it comes from an image, a grid of solid cells; never
both. The laser sees the solids that cut its plane, the body touches those that cut its height.
"""

import hashlib
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.drawing import draw_segments, fill_shapes, ring_edges
from lidarium.envs.floors.raster import Raster, cells_within, frame_of, sampled

MAX_COORDINATE_M = 1e8
"""Farthest that a floor may lie from the origin of its frame [m]."""

MAX_EXTENT_M = 10_000.0
"""Longest side of a floor [m]."""

MAX_BEYOND_M = 1_000.0
"""Farthest that the obstacles may reach beyond the bounds [m]."""

MAX_OUTLINE_M = 500_000.0
"""Longest sum of all outlines: each is followed cell by cell [m]."""

MAX_PAIRS = 250_000
"""Maximum product of the numbers of walls and doors: each is compared with each."""

MAX_CORNERS = 2_000_000
"""Maximum number of corners of all outlines."""


def check_extent(what: str, bounds: Iterable[float], rings: Iterable[NDArray[np.float64]] = ()) -> None:
    """Check that a floor is not too large.

    Parameters
    ----------
    bounds : (x_min, y_min, x_max, y_max)
        Rectangle that holds it [m].
    rings : iterable of (N, 2) float64
        Closed outlines of the obstacles [m].
    """
    low_x, low_y, high_x, high_y = bounds
    side, farthest = max(high_x - low_x, high_y - low_y), max(map(abs, (low_x, low_y, high_x, high_y)))
    if not (side <= MAX_EXTENT_M and farthest <= MAX_COORDINATE_M):
        raise ValueError(
            f"{what} has a side of {side:g} m, up to {farthest:g} m from its origin; want at most "
            f"{MAX_EXTENT_M:,.0f} m, up to {MAX_COORDINATE_M:,.0f} m: check its scale"
        )
    outlines = [np.asarray(ring, np.float64) for ring in rings if len(ring)]
    if not outlines:
        return
    corners = np.concatenate(outlines)
    if not (
        (corners >= [low_x - MAX_BEYOND_M, low_y - MAX_BEYOND_M]).all()
        and (corners <= [high_x + MAX_BEYOND_M, high_y + MAX_BEYOND_M]).all()
    ):
        raise ValueError(
            f"{what} has something that stands more than {MAX_BEYOND_M:,.0f} m beyond its bounds; want "
            "all of it within: check its scale"
        )
    ends = np.cumsum([len(ring) for ring in outlines])
    following = np.arange(1, len(corners) + 1)
    following[ends - 1] = np.concatenate([[0], ends[:-1]])
    steps = corners[following] - corners
    if len(corners) > MAX_CORNERS or float(np.hypot(steps[:, 0], steps[:, 1]).sum()) > MAX_OUTLINE_M:
        raise ValueError(
            f"{what} has more than {MAX_CORNERS:,} corners or {MAX_OUTLINE_M:,.0f} m of walls; want "
            "fewer: check its scale, or part it"
        )


def check_pairs(what: str, walls: int, doors: int) -> None:
    """Check that comparing all walls with all doors does not take too long."""
    if walls * doors > MAX_PAIRS:
        raise ValueError(f"{what} has {walls:,} walls and {doors:,} doors; want a product of {MAX_PAIRS:,}")


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A vertical prism.

    Attributes
    ----------
    polygon : (N, 2) float64
        Corners x, y in metres, at least three, in order, without repetition of the first.
    z_low, z_high : float
        Height range [m]; ``math.inf`` for a wall that reaches the ceiling.
    holes : tuple of (M, 2) float64
        Rings inside the polygon that are not solid [m].
    """

    polygon: NDArray[np.float64]
    z_low: float = 0.0
    z_high: float = math.inf
    holes: tuple[NDArray[np.float64], ...] = ()

    def __post_init__(self) -> None:
        if not self.z_low < self.z_high:
            raise ValueError(
                f"solid from z_low={self.z_low} to z_high={self.z_high} m has no height; want z_low < z_high"
            )
        object.__setattr__(self, "polygon", _ring("polygon", self.polygon))
        object.__setattr__(self, "holes", tuple(_ring("hole", hole) for hole in self.holes))

    @property
    def edges(self) -> NDArray[np.float64]:
        """Edges x1, y1, x2, y2 of the polygon and its holes, (E, 4) float64 [m]."""
        return np.concatenate([ring_edges(ring) for ring in (self.polygon, *self.holes)])

    def cuts(self, z_low: float, z_high: float) -> bool:
        """Return whether the solid cuts a height range [m].

        It is a plane if ``z_low == z_high``.
        """
        if z_low == z_high:
            return self.z_low <= z_low < self.z_high
        return self.z_low < z_high and self.z_high > z_low


def _following(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return of each corner the next one; `np.roll` takes five times as long for so few."""
    return np.concatenate([values[1:], values[:1]])


def _area(polygon: NDArray[np.float64]) -> float:
    x, y = (polygon - polygon[0]).T
    return abs(float(np.dot(x, _following(y)) - np.dot(y, _following(x)))) / 2.0


def _width_of(polygon: NDArray[np.float64]) -> float:
    """Return the width of a polygon.

    It is that of its smallest rectangle or, for a bent strip, of the strip.
    """
    edges = _following(polygon) - polygon
    perimeter = float(np.hypot(*edges.T).sum())
    rectangle = min(cv2.minAreaRect((polygon - polygon[0]).astype(np.float32))[1])
    turns = edges[:, 0] * _following(edges[:, 1]) - edges[:, 1] * _following(edges[:, 0])
    convex = bool((turns >= -1e-12).all() or (turns <= 1e-12).all())
    return rectangle if convex or perimeter == 0.0 else min(rectangle, 2.0 * _area(polygon) / perimeter)


def _middle_line(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the segments that replace a thin polygon.

    They are the middle line of four corners, otherwise the outline.
    """
    if len(polygon) != 4:
        return ring_edges(polygon)
    middles = (polygon + _following(polygon)) / 2.0
    lengths = np.hypot(*(_following(polygon) - polygon).T)
    k = 0 if lengths[0] + lengths[2] <= lengths[1] + lengths[3] else 1
    return np.concatenate([middles[k], middles[k + 2]])[None]


def _ring(kind: str, ring: NDArray[np.float64]) -> NDArray[np.float64]:
    corners = np.array(ring, dtype=np.float64, order="C")
    if corners.ndim != 2 or corners.shape[0] < 3 or corners.shape[1] != 2 or not np.isfinite(corners).all():
        raise ValueError(
            f"{kind} has shape {corners.shape} or values that are not finite; want at least 3 points (x, y) in metres"
        )
    return corners


MAX_RASTER_CELLS = 200_000_000

CEILING = 2.5
"""Height of a ceiling if the floor does not state it [m]."""


@dataclass(frozen=True, eq=False)
class Floor:
    """A floor of a building.

    Attributes
    ----------
    name : str
        Name in the catalogue, or the stem of the file it comes from.
    bounds : (x_min, y_min, x_max, y_max)
        Rectangle that holds the floor [m]; everything outside is solid.
    solids : tuple of Solid
        Obstacles; empty if ``cells`` is given.
    cells : Raster or None
        Solid cells of a floor that comes from an image, at the image's own resolution.
    starts : (K, 3) float64
        Proposed starts x, y, theta [m, rad], far apart from each other; may be empty (then starts are drawn
        by seed).
    goal : (x, y) or None
        Goal of robots that have one [m].
    ceiling : float
        Height of the ceiling, to which solids without a height reach [m].
    wall_height : float
        Height of walls that end below the ceiling [m]; infinite by default, when all reach it.
    areas : Raster or None
        Solid cells of a picture with several free areas, of which one is the floor; see ``areas.around``.
    left_out_m2 : float
        Free area of a picture that is not connected with the floor, without the surroundings of a building [m2].
    remark : str
        Assumptions on a file that does not state them, and the parts of it that are left out.
    """

    name: str
    bounds: tuple[float, float, float, float]
    solids: tuple[Solid, ...] = ()
    cells: Raster | None = None
    starts: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    goal: tuple[float, float] | None = None
    ceiling: float = CEILING
    wall_height: float = math.inf
    areas: Raster | None = None
    left_out_m2: float = 0.0
    remark: str = ""

    def __post_init__(self) -> None:
        x_min, y_min, x_max, y_max = self.bounds
        if not np.isfinite(self.bounds).all() or x_min >= x_max or y_min >= y_max:
            raise ValueError(
                f"floor {self.name!r} has bounds {self.bounds}; want finite x_min < x_max and y_min < y_max in metres"
            )
        check_extent(
            f"floor {self.name!r}",
            self.bounds,
            (ring for solid in self.solids for ring in (solid.polygon, *solid.holes)),
        )
        if not (math.isfinite(self.ceiling) and self.ceiling > 0.0):
            raise ValueError(f"floor {self.name!r} has its ceiling at {self.ceiling} m; want a positive height")
        if self.solids and self.cells is not None:
            raise ValueError(f"floor {self.name!r} has {len(self.solids)} solids and cells too; want one or the other")
        if self.cells is not None and (self.cells.solid.ndim != 2 or not self.cells.resolution > 0.0):
            raise ValueError(
                f"floor {self.name!r} has cells of shape {self.cells.solid.shape} at {self.cells.resolution} "
                "m; want a grid, resolution > 0"
            )
        starts = np.array(self.starts, dtype=np.float64)  # a copy: floors are shared by environments
        if starts.ndim != 2 or starts.shape[1] != 3 or not np.isfinite(starts).all():
            raise ValueError(
                f"floor {self.name!r} has starts of shape {starts.shape} or not finite; want (K, 3): x, y, theta"
            )
        if self.goal is not None and (len(self.goal) != 2 or not np.isfinite(self.goal).all()):
            raise ValueError(f"floor {self.name!r} has goal {self.goal}; want (x, y) in metres")
        starts.flags.writeable = False
        object.__setattr__(self, "starts", starts)

    def is_wall(self, solid: Solid) -> bool:
        """Return whether a solid is a wall: it reaches the ceiling, or is as high as walls; others are furniture."""
        return solid.z_high >= self.ceiling or math.isclose(solid.z_high, self.wall_height, abs_tol=1e-3)

    def raster(self, resolution: float, z_low: float, z_high: float) -> Raster:
        """Return the solid cells at one height.

        A cell is solid if its centre lies in a solid that cuts the height; solids too thin for that are drawn
        as 4-connected lines, so that no ray leaks between cells. Everything outside of the bounds is solid.
        The origin is a whole multiple of 0.1 m, rows and columns are multiples of 8. A floor made of cells
        has them at all heights; the nearest one counts.

        Parameters
        ----------
        resolution : float
            Side of a cell [m].
        z_low, z_high : float
            Height range [m]; equal for the plane of a laser.
        """
        if not (math.isfinite(resolution) and resolution > 0.0):
            raise ValueError(f"resolution is {resolution} m; want a positive number")
        if not z_low <= z_high:
            raise ValueError(f"height range is {z_low} to {z_high} m; want z_low <= z_high")
        origin, (rows, columns) = frame_of(self.bounds, resolution)
        if rows * columns > MAX_RASTER_CELLS:
            raise ValueError(self._too_large(rows, columns, resolution))
        solid = np.ones((rows, columns), dtype=np.uint8)
        inside = cells_within(self.bounds, origin, resolution)
        if self.cells is not None:
            solid[inside] = sampled(self.cells, origin, resolution, inside)
        else:
            solid[inside] = 0
            standing = [part for part in self.solids if part.cuts(z_low, z_high)]
            fill_shapes(solid, origin, resolution, [part.edges for part in standing], 1)
            # Strips narrower than a cell's diagonal may miss centres and leak between diagonal neighbours.
            thin = [
                _middle_line(part.polygon)
                for part in standing
                if not part.holes and _width_of(part.polygon) < math.sqrt(2.0) * resolution
            ]
            if thin:
                draw_segments(solid, origin, resolution, np.concatenate(thin), 1)
        return Raster(solid, origin, resolution)

    def _too_large(self, rows: int, columns: int, resolution: float) -> str:
        fitting = resolution
        while math.prod(frame_of(self.bounds, fitting)[1]) > MAX_RASTER_CELLS:
            fitting = math.ceil(fitting * 1.05 * 1000.0) / 1000.0
        return (
            f"floor {self.name!r} has {columns} x {rows} cells at {resolution} m, more than "
            f"{MAX_RASTER_CELLS}; "
            f"a resolution of {fitting:g} m fits"
        )

    @cached_property
    def sha256(self) -> str:
        """Hash of the obstacles, the starts and the goal, to a micrometre.

        The name does not count.
        """
        digest = hashlib.sha256()
        _hash_numbers(digest, "bounds", self.bounds)
        for solid in self.solids:
            _hash_numbers(digest, "height", (solid.z_low, solid.z_high))
            for ring in (solid.polygon, *solid.holes):
                _hash_numbers(digest, "ring", ring)
        if self.cells is not None:
            _hash_numbers(digest, "cells", (*self.cells.origin, self.cells.resolution, *self.cells.solid.shape))
            digest.update(np.packbits(self.cells.solid != 0).tobytes())
        _hash_numbers(digest, "starts", self.starts)
        _hash_numbers(digest, "goal", self.goal or ())
        if self.ceiling != CEILING:
            _hash_numbers(digest, "ceiling", (self.ceiling,))
        return digest.hexdigest()

    @cached_property
    def geometry_sha256(self) -> str:
        """Hash of the bounds and of the solids, to the bit.

        Floors that share it have the same rasters.
        """
        digest = hashlib.sha256(np.array(self.bounds, np.float64).tobytes())
        for solid in self.solids:
            digest.update(np.array((solid.z_low, solid.z_high, 1 + len(solid.holes)), np.float64).tobytes())
            for ring in (solid.polygon, *solid.holes):
                digest.update(len(ring).to_bytes(8, "little") + ring.tobytes())
        if self.cells is not None:
            digest.update(
                np.array((*self.cells.origin, self.cells.resolution, *self.cells.solid.shape), np.float64).tobytes()
            )
            digest.update(np.packbits(self.cells.solid != 0).tobytes())
        if self.ceiling != CEILING:
            digest.update(np.array((self.ceiling,), np.float64).tobytes())
        return digest.hexdigest()


def _hash_numbers(digest: "hashlib._Hash", label: str, numbers: "NDArray[np.float64] | tuple[float, ...]") -> None:
    """Add numbers in millionths; infinite ones keep their sign."""
    scaled = np.clip(np.rint(np.asarray(numbers, dtype=np.float64).ravel() * 1e6), -(2.0**62), 2.0**62)
    digest.update(f"{label}:{scaled.size};".encode())
    digest.update(scaled.astype("<i8").tobytes())
