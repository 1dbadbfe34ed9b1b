"""What the kernels look up for one floor: rays, bodies and the cells that count.

Shared by all episodes on it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.faces import Faces, faces_of
from lidarium.envs.floors.floor import Floor, Raster
from lidarium.envs.simulation.kernels.contact import distance_bound
from lidarium.envs.simulation.kernels.ray_tables import RayTables

LIMITLESS_BODY = 0.05
"""The body touches what stands higher than this above the floor [m]."""


@dataclass(frozen=True)
class FloorTables:
    """Rasters and look-up tables of one floor for one height of laser and body.

    Attributes
    ----------
    laser : Raster
        Solid cells in the laser's plane.
    body : Raster
        Solid cells within the body's height.
    rays : RayTables
        Tables of the ray casters.
    bound : (rows, columns) uint8
        Lower bound of the distance to the bodies' solid cells [cells].
    floor : Floor or None
        What stands there; None where the tables were made of rasters alone.
    """

    laser: Raster
    body: Raster
    rays: RayTables = field(repr=False)
    bound: NDArray[np.uint8] = field(repr=False)
    floor: Floor | None = field(default=None, repr=False)

    @classmethod
    def of_floor(
        cls, floor: Floor, resolution: float, laser_height: float, body_height: float
    ) -> "FloorTables":
        """Rasterise a floor and prepare its tables.

        Parameters
        ----------
        floor : Floor
            What stands there.
        resolution : float
            Side of a cell of the world's raster [m].
        laser_height, body_height : float
            Height of the laser's plane and of the highest body [m].
        """
        body = floor.raster(resolution, LIMITLESS_BODY, body_height)
        # A floor of one height has the same cells in both rasters; keep one.
        laser = floor.raster(resolution, laser_height, laser_height)
        if np.array_equal(laser.solid, body.solid):
            laser = body
        return cls(laser, body, RayTables(laser.solid), distance_bound(body.solid), floor)._frozen()

    @classmethod
    def unpacked(cls, arrays: Mapping[str, NDArray[Any]], floor: Floor) -> "FloorTables":
        """Make the tables of a floor of what `packed` returned."""
        x, y, resolution = arrays["frame"].tolist()
        rasters = [
            Raster(_cells(arrays[name], arrays["bound"].shape), (x, y), resolution)
            for name in ("body", "laser")
            if name in arrays
        ]
        return cls(rasters[-1], rasters[0], RayTables(rasters[-1].solid), arrays["bound"], floor)._frozen()

    def packed(self) -> dict[str, NDArray[Any]]:
        """Return the parts that are expensive to make: rasters, bound and frame.

        Rasters are packed as bits, ``laser`` where it is not the body's.
        """
        arrays: dict[str, NDArray[Any]] = {
            "frame": self.frame,
            "bound": self.bound,
            "body": np.packbits(self.body.solid),
        }
        return arrays if self.laser is self.body else {**arrays, "laser": np.packbits(self.laser.solid)}

    @cached_property
    def faces(self) -> Faces:
        """Faces of the floor, for cameras.

        Raises
        ------
        ValueError
            Where the tables were made of rasters alone.
        """
        if self.floor is None:
            raise ValueError("these tables know no floor (floor is None); want those of a floor for a camera")
        return faces_of(self.floor)

    @property
    def nbytes(self) -> int:
        """How much memory the arrays take, and what episodes have made the rasters keep."""
        rasters = [self.body] if self.laser is self.body else [self.body, self.laser]
        tables: list[NDArray[Any]] = [self.rays.squares, self.rays.faces, self.rays.face_starts, self.bound]
        return sum(raster.nbytes for raster in rasters) + sum(array.nbytes for array in tables)

    def _frozen(self) -> "FloorTables":
        """Make the arrays read-only: all episodes on the floor share them."""
        for array in (
            self.body.solid,
            self.laser.solid,
            self.rays.squares,
            self.rays.faces,
            self.rays.face_starts,
            self.bound,
        ):
            array.flags.writeable = False
        return self

    def __deepcopy__(self, memo: dict[int, object]) -> "FloorTables":
        """Tables are never written after they are made: copies share them."""
        return self

    @property
    def row(self) -> NDArray[np.int64]:
        """Row of the kernels' table of floors, shape (10,).

        It holds the rays' 8 numbers and the addresses of the bound and of the solid cells.
        """
        return np.concatenate(
            [self.rays.addresses, [self.bound.ctypes.data, self.body.solid.ctypes.data]]
        ).astype(np.int64)

    @property
    def frame(self) -> NDArray[np.float64]:
        """Origin x, y [m] and resolution [m/cell], shape (3,)."""
        return np.array([*self.laser.origin, self.laser.resolution])


def _cells(bits: NDArray[np.uint8], shape: tuple[int, ...]) -> NDArray[np.uint8]:
    return np.unpackbits(bits, count=shape[0] * shape[1]).reshape(shape)
