"""Floors: what stands in a building, in metres, and its rasters.

A floor is a set of solids (vertical prisms) or, where it comes from an image, a grid of solid cells; never
both. The laser sees the solids that cut its plane, the body touches those that cut its height.
"""

import hashlib
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.drawing import draw_segments, fill_shapes, ring_edges
from lidarium.envs.floors.extent import check_extent

MAX_RASTER_CELLS = 200_000_000

# Origins of rasters are whole multiples of this [m], so that belief grids of every usual resolution line up
# with them.
LATTICE = 0.1
_PADDING = 8


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

        It is a plane where ``z_low == z_high``.
        """
        if z_low == z_high:
            return self.z_low <= z_low < self.z_high
        return self.z_low < z_high and self.z_high > z_low


@dataclass(frozen=True, slots=True, eq=False)
class Raster:
    """Solid cells of a floor at one height.

    Attributes
    ----------
    solid : (rows, columns) uint8
        1 where the cell is solid; row 0 at the lowest y. The outermost ring of cells is solid.
    origin : (x, y)
        Lower left corner of cell (0, 0) [m].
    resolution : float
        Side of a cell [m].
    kept : dict
        What was made of the cells, where they are read-only, see ``free_space``.
    """

    solid: NDArray[np.uint8]
    origin: tuple[float, float]
    resolution: float
    kept: dict[tuple[Any, ...], Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def nbytes(self) -> int:
        """How much memory the cells take, and what is kept of them."""
        sizes: list[int] = [value.nbytes for value in list(self.kept.values()) if value is not None]
        return self.solid.nbytes + sum(sizes)


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
        What stands there; empty where ``cells`` is given.
    cells : Raster or None
        Solid cells of a floor that comes from an image, at the image's own resolution.
    starts : (K, 3) float64
        Proposed starts x, y, theta [m, rad], far apart from each other; may be empty (then starts are drawn
        by seed).
    goal : (x, y) or None
        Where robots with a goal should go [m].
    """

    name: str
    bounds: tuple[float, float, float, float]
    solids: tuple[Solid, ...] = ()
    cells: Raster | None = None
    starts: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    goal: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        x_min, y_min, x_max, y_max = self.bounds
        if not np.isfinite(self.bounds).all() or x_min >= x_max or y_min >= y_max:
            raise ValueError(
                f"floor {self.name!r} has bounds {self.bounds}; want finite x_min < x_max and y_min < y_max "
                "in metres"
            )
        check_extent(
            f"floor {self.name!r}",
            self.bounds,
            (ring for solid in self.solids for ring in (solid.polygon, *solid.holes)),
        )
        if self.solids and self.cells is not None:
            raise ValueError(
                f"floor {self.name!r} has {len(self.solids)} solids and cells too; want one or the other"
            )
        if self.cells is not None and (self.cells.solid.ndim != 2 or not self.cells.resolution > 0.0):
            raise ValueError(
                f"floor {self.name!r} has cells of shape {self.cells.solid.shape} at {self.cells.resolution} "
                "m; want a grid, resolution > 0"
            )
        starts = np.asarray(self.starts, dtype=np.float64)
        if starts.ndim != 2 or starts.shape[1] != 3 or not np.isfinite(starts).all():
            raise ValueError(
                f"floor {self.name!r} has starts of shape {starts.shape} or not finite; want (K, 3): x, y, "
                "theta"
            )
        if self.goal is not None and (len(self.goal) != 2 or not np.isfinite(self.goal).all()):
            raise ValueError(f"floor {self.name!r} has goal {self.goal}; want (x, y) in metres")
        object.__setattr__(self, "starts", starts)

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

        Returns
        -------
        Raster
            The cells.

        Raises
        ------
        ValueError
            If the resolution is not positive, the height range is upside down, or the raster has more than
            `MAX_RASTER_CELLS` cells.
        """
        if not (math.isfinite(resolution) and resolution > 0.0):
            raise ValueError(f"resolution is {resolution} m; want a positive number")
        if not z_low <= z_high:
            raise ValueError(f"height range is {z_low} to {z_high} m; want z_low <= z_high")
        origin, (rows, columns) = _frame(self.bounds, resolution)
        if rows * columns > MAX_RASTER_CELLS:
            raise ValueError(self._too_large(rows, columns, resolution))
        solid = np.ones((rows, columns), dtype=np.uint8)
        inside = _inside(self.bounds, origin, resolution)
        if self.cells is not None:
            solid[inside] = _sample(self.cells, origin, resolution, inside)
        else:
            solid[inside] = 0
            standing = [part for part in self.solids if part.cuts(z_low, z_high)]
            fill_shapes(solid, origin, resolution, [part.edges for part in standing], 1)
            # Strips narrower than a cell's diagonal may miss centres and leak between diagonal neighbours.
            thin = [
                _line(part.polygon)
                for part in standing
                if not part.holes and _width(part.polygon) < math.sqrt(2.0) * resolution
            ]
            if thin:
                draw_segments(solid, origin, resolution, np.concatenate(thin), 1)
        return Raster(solid, origin, resolution)

    def _too_large(self, rows: int, columns: int, resolution: float) -> str:
        fitting = resolution
        while math.prod(_frame(self.bounds, fitting)[1]) > MAX_RASTER_CELLS:
            fitting = math.ceil(fitting * 1.05 * 1000.0) / 1000.0
        return (
            f"floor {self.name!r} has {columns} x {rows} cells at {resolution} m, more than "
            f"{MAX_RASTER_CELLS}; "
            f"a resolution of {fitting:g} m fits"
        )

    @cached_property
    def sha256(self) -> str:
        """Hash of what stands there, the starts and the goal, to a micrometre.

        The name does not count.
        """
        digest = hashlib.sha256()
        _hash_numbers(digest, "bounds", self.bounds)
        for solid in self.solids:
            _hash_numbers(digest, "height", (solid.z_low, solid.z_high))
            for ring in (solid.polygon, *solid.holes):
                _hash_numbers(digest, "ring", ring)
        if self.cells is not None:
            _hash_numbers(
                digest, "cells", (*self.cells.origin, self.cells.resolution, *self.cells.solid.shape)
            )
            digest.update(np.packbits(self.cells.solid != 0).tobytes())
        _hash_numbers(digest, "starts", self.starts)
        _hash_numbers(digest, "goal", self.goal or ())
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
                np.array(
                    (*self.cells.origin, self.cells.resolution, *self.cells.solid.shape), np.float64
                ).tobytes()
            )
            digest.update(np.packbits(self.cells.solid != 0).tobytes())
        return digest.hexdigest()


def _ring(kind: str, ring: NDArray[np.float64]) -> NDArray[np.float64]:
    corners = np.ascontiguousarray(ring, dtype=np.float64)
    if corners.ndim != 2 or corners.shape[0] < 3 or corners.shape[1] != 2 or not np.isfinite(corners).all():
        raise ValueError(
            f"{kind} has shape {corners.shape} or values that are not finite; want at least 3 points (x, y) "
            "in metres"
        )
    return corners


def _frame(
    bounds: tuple[float, float, float, float], resolution: float
) -> tuple[tuple[float, float], tuple[int, int]]:
    """Return origin and (rows, columns) of the raster.

    It has at least one cell beyond the bounds on all sides.
    """
    margin = math.ceil(resolution / LATTICE - 1e-9)
    # Divided, not multiplied: 3 / 10 is the double nearest to 0.3, and 3 * 0.1 is not.
    x, y = ((math.floor(low / LATTICE + 1e-9) - margin) / round(1.0 / LATTICE) for low in bounds[:2])
    columns, rows = (
        math.ceil((high - low) / resolution - 1e-9) + 1 for low, high in ((x, bounds[2]), (y, bounds[3]))
    )
    return (x, y), (-(-rows // _PADDING) * _PADDING, -(-columns // _PADDING) * _PADDING)


def _inside(
    bounds: tuple[float, float, float, float], origin: tuple[float, float], resolution: float
) -> tuple[slice, slice]:
    """Return rows and columns of the cells whose centre is within the bounds."""
    x_low, y_low, x_high, y_high = ((bounds[k] - origin[k % 2]) / resolution - 0.5 for k in range(4))
    return (
        slice(math.ceil(y_low - 1e-6), math.floor(y_high + 1e-6) + 1),
        slice(math.ceil(x_low - 1e-6), math.floor(x_high + 1e-6) + 1),
    )


def _sample(
    cells: Raster, origin: tuple[float, float], resolution: float, inside: tuple[slice, slice]
) -> NDArray[np.uint8]:
    """Return the image cell under each cell centre; solid outside of the image."""
    indices = []
    for axis in (0, 1):
        centres = origin[1 - axis] + (np.arange(inside[axis].start, inside[axis].stop) + 0.5) * resolution
        indices.append(
            np.floor((centres - cells.origin[1 - axis]) / cells.resolution + 1e-6).astype(np.int64)
        )
    framed = np.pad((cells.solid != 0).astype(np.uint8), 1, constant_values=1)
    rows, columns = (np.clip(index + 1, 0, framed.shape[axis] - 1) for axis, index in enumerate(indices))
    return np.take(framed[rows], columns, axis=1)


def _area(polygon: NDArray[np.float64]) -> float:
    x, y = (polygon - polygon[0]).T
    return abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))) / 2.0


def _width(polygon: NDArray[np.float64]) -> float:
    """Return the width of a polygon.

    It is that of its smallest rectangle or, for a bent strip, of the strip.
    """
    edges = np.roll(polygon, -1, axis=0) - polygon
    perimeter = float(np.hypot(*edges.T).sum())
    rectangle = min(cv2.minAreaRect((polygon - polygon[0]).astype(np.float32))[1])
    turns = edges[:, 0] * np.roll(edges[:, 1], -1) - edges[:, 1] * np.roll(edges[:, 0], -1)
    convex = bool((turns >= -1e-12).all() or (turns <= 1e-12).all())
    return rectangle if convex or perimeter == 0.0 else min(rectangle, 2.0 * _area(polygon) / perimeter)


def _line(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the segments that stand for a thin polygon.

    They are the middle line of four corners, else the outline.
    """
    if len(polygon) != 4:
        return ring_edges(polygon)
    middles = (polygon + np.roll(polygon, -1, axis=0)) / 2.0
    lengths = np.hypot(*(np.roll(polygon, -1, axis=0) - polygon).T)
    k = 0 if lengths[0] + lengths[2] <= lengths[1] + lengths[3] else 1
    return np.concatenate([middles[k], middles[k + 2]])[None]


def _hash_numbers(
    digest: "hashlib._Hash", label: str, numbers: "NDArray[np.float64] | tuple[float, ...]"
) -> None:
    """Add numbers in millionths; what is infinite keeps its sign."""
    scaled = np.clip(np.rint(np.asarray(numbers, dtype=np.float64).ravel() * 1e6), -(2.0**62), 2.0**62)
    digest.update(f"{label}:{scaled.size};".encode())
    digest.update(scaled.astype("<i8").tobytes())
