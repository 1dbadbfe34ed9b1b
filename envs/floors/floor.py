"""Floors: what stands in a building, in metres, and its rasters.

A floor is a set of solids (vertical prisms) or, where it comes from an image, a grid of solid cells; never
both. The laser sees the solids that cut its plane, the body touches those that cut its height.
"""

import hashlib
import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.drawing import draw_segments, fill_shapes
from lidarium.envs.floors.extent import check_extent
from lidarium.envs.floors.raster import Raster, cells_within, frame_of, sampled
from lidarium.envs.floors.solid import Solid, middle_line, width_of

MAX_RASTER_CELLS = 200_000_000

CEILING = 2.5
"""Height of a ceiling where a floor says nothing [m]."""


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
    ceiling : float
        Height of the ceiling, to which solids without a height reach [m].
    areas : Raster or None
        Solid cells of a picture with several free areas, of which one is the floor; see ``areas.around``.
    remark : str
        What was assumed of a picture that does not say it.
    """

    name: str
    bounds: tuple[float, float, float, float]
    solids: tuple[Solid, ...] = ()
    cells: Raster | None = None
    starts: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    goal: tuple[float, float] | None = None
    ceiling: float = CEILING
    areas: Raster | None = None
    remark: str = ""

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
        if not (math.isfinite(self.ceiling) and self.ceiling > 0.0):
            raise ValueError(
                f"floor {self.name!r} has its ceiling at {self.ceiling} m; want a positive height"
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
                middle_line(part.polygon)
                for part in standing
                if not part.holes and width_of(part.polygon) < math.sqrt(2.0) * resolution
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
                np.array(
                    (*self.cells.origin, self.cells.resolution, *self.cells.solid.shape), np.float64
                ).tobytes()
            )
            digest.update(np.packbits(self.cells.solid != 0).tobytes())
        if self.ceiling != CEILING:
            digest.update(np.array((self.ceiling,), np.float64).tobytes())
        return digest.hexdigest()


def _hash_numbers(
    digest: "hashlib._Hash", label: str, numbers: "NDArray[np.float64] | tuple[float, ...]"
) -> None:
    """Add numbers in millionths; what is infinite keeps its sign."""
    scaled = np.clip(np.rint(np.asarray(numbers, dtype=np.float64).ravel() * 1e6), -(2.0**62), 2.0**62)
    digest.update(f"{label}:{scaled.size};".encode())
    digest.update(scaled.astype("<i8").tobytes())
