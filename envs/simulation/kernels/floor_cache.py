"""Tables of floors, shared by processes and environments.

The environments of a process share them in memory, all processes on disk.

The disk stores data that are expensive to make and small: the rasters as bits and the distance bound
(`FloorTables.packed`), some 20 kB a floor. The tables of the rays, four bytes a cell, are made from them in
the time that it would take to read or unpack them.
"""

from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from threading import Lock
from typing import Any, Generic, TypeVar
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.catalogue.store import Store, floor_store, hash_of_code, mebibytes
from lidarium.envs.floors.faces import Faces, faces_of
from lidarium.envs.floors.floor import Floor, Raster
from lidarium.envs.floors.raster import Runs
from lidarium.envs.simulation.kernels.contact import distance_bound
from lidarium.envs.simulation.kernels.ray_tables import RayTables

LIMITLESS_BODY = 0.05
"""Minimum height of objects that the body touches [m]."""


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
        The floor itself; None if the tables were made of rasters alone.
    """

    laser: Raster
    body: Raster
    rays: RayTables = field(repr=False)
    bound: NDArray[np.uint8] = field(repr=False)
    floor: Floor | None = field(default=None, repr=False)

    @classmethod
    def of_floor(cls, floor: Floor, resolution: float, laser_height: float, body_height: float) -> "FloorTables":
        """Rasterise a floor and prepare its tables.

        Parameters
        ----------
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
        """Make the tables of a floor from the result of `packed`."""
        x, y, resolution = arrays["frame"].tolist()
        rasters = [
            Raster(_cells(arrays[name], arrays["bound"].shape), (x, y), resolution)
            for name in ("body", "laser")
            if name in arrays
        ]
        return cls(rasters[-1], rasters[0], RayTables(rasters[-1].solid), arrays["bound"], floor)._frozen()

    def packed(self) -> dict[str, NDArray[Any]]:
        """Return the parts that are expensive to make: rasters, bound and frame.

        Rasters are packed as bits, ``laser`` if it is not the body's.
        """
        arrays: dict[str, NDArray[Any]] = {
            "frame": self.frame,
            "bound": self.bound,
            "body": np.packbits(self.body.solid),
        }
        return arrays if self.laser is self.body else {**arrays, "laser": np.packbits(self.laser.solid)}

    @cached_property
    def faces(self) -> Faces:
        """Faces of the floor, for cameras."""
        if self.floor is None:
            raise ValueError("these tables know no floor (floor is None); want those of a floor for a camera")
        return faces_of(self.floor)

    @property
    def nbytes(self) -> int:
        """Memory of the arrays and of the data that episodes have added to the rasters."""
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
        return np.concatenate([self.rays.addresses, [self.bound.ctypes.data, self.body.solid.ctypes.data]]).astype(
            np.int64
        )

    @property
    def frame(self) -> NDArray[np.float64]:
        """Origin x, y [m] and resolution [m/cell], shape (3,)."""
        return np.array([*self.laser.origin, self.laser.resolution])


def _cells(bits: NDArray[np.uint8], shape: tuple[int, ...]) -> NDArray[np.uint8]:
    return np.unpackbits(bits, count=shape[0] * shape[1]).reshape(shape)


SIZE_VARIABLE = "LIDARIUM_FLOOR_CACHE_MIB"
"""Environment variable: the limit of unused tables in a process [MiB].

Unused tables are those that no episode uses.
"""

DEFAULT_MIB = 256.0
"""Maximum size by default [MiB]."""

REMEMBERED_SHARE = 0.125
"""Share of it for data of floors whose tables were removed."""

Value = TypeVar("Value")

MADE_BY = (
    "envs/floors",
    "envs/settings/lidar.py",
    "envs/settings/odometry.py",
    "envs/simulation/disturbances",
    "mapping/grids/scan_geometry.py",
    "mapping/geometry",
    "envs/simulation/kernels/arrays.py",
    "envs/simulation/kernels/floor_cache.py",
    "envs/simulation/kernels/contact.py",
    "envs/simulation/kernels/ray_tables.py",
    "mapping/files/output.py",
    "mapping/kernels",
)
"""Sources that determine the stored data of a floor."""


class TablesCache:
    """Tables used last, bounded in bytes.

    Tables in use elsewhere are found, too, and never made twice. Data that episodes added to the rasters of removed
    tables stay longer: they are small, and take longer to make than the tables.

    Tables grow as episodes add data to their rasters, so their size is read at each use.

    Parameters
    ----------
    max_bytes : int
        The most that the cache keeps alive.

    Attributes
    ----------
    nbytes : int
        Maximum size of the kept values [bytes].
    """

    def __init__(self, max_bytes: int) -> None:
        self.max_bytes = max_bytes
        room = int(REMEMBERED_SHARE * max_bytes)
        self._kept: _UsedLast[FloorTables] = _UsedLast(max_bytes - room)
        self._remembered: _UsedLast[dict[tuple[Any, ...], Runs]] = _UsedLast(room)
        self._alive: WeakValueDictionary[str, FloorTables] = WeakValueDictionary()
        self._lock = Lock()

    @property
    def nbytes(self) -> int:
        """Size of the kept values [bytes]."""
        return self._kept.nbytes + self._remembered.nbytes

    def get(self, key: str, make: Callable[[], FloorTables]) -> FloorTables:
        """Return the tables of a key; ``make`` is called if they are not in memory."""
        tables = self._alive.get(key)
        if tables is None:
            tables = make()
        with self._lock:
            # Of two threads that made the same, one wins.
            tables = self._alive.setdefault(key, tables)
            tables.body.kept.update(self._remembered.pop(key) or {})
            for gone, old in self._kept.put(key, tables, tables.nbytes):
                kept = dict(old.body.kept)
                self._remembered.put(gone, kept, sum(runs.nbytes for runs in kept.values()))
        return tables


class _UsedLast(Generic[Value]):
    """Values used last, bounded in bytes."""

    def __init__(self, max_bytes: int) -> None:
        self.max_bytes, self.nbytes = max_bytes, 0
        self._values: OrderedDict[str, tuple[Value, int]] = OrderedDict()

    def pop(self, key: str) -> Value | None:
        """Remove and return a value, None if it is not stored."""
        value, size = self._values.pop(key, (None, 0))
        self.nbytes -= size
        return value

    def put(self, key: str, value: Value, size: int) -> list[tuple[str, Value]]:
        """Keep a value of that many bytes; return the removed values with their keys."""
        self.pop(key)
        self._values[key] = value, size
        self.nbytes += size
        gone = []
        while self.nbytes > self.max_bytes:
            old, (former, length) = self._values.popitem(last=False)
            self.nbytes -= length
            gone.append((old, former))
        return gone


def floor_tables(floor: Floor, raster_resolution: float, laser_height: float, body_height: float) -> FloorTables:
    """Return the kernels' tables of a floor.

    They are those of this process, otherwise those of the store, otherwise new ones.

    Parameters
    ----------
    raster_resolution : float
        Side of a cell of the world's raster [m].
    laser_height, body_height : float
        Height of the laser's plane and of the highest body [m].
    """
    key = _key(floor, raster_resolution, laser_height, body_height)

    def make() -> FloorTables:
        kept = floor_store().load(key)
        if kept is not None:
            return FloorTables.unpacked(kept, floor)
        tables = FloorTables.of_floor(floor, raster_resolution, laser_height, body_height)
        floor_store().save(key, tables.packed())
        return tables

    return _cache(mebibytes(SIZE_VARIABLE, DEFAULT_MIB)).get(key, make)


def prepare_tables(
    store: Store, floor: Floor, raster_resolution: float, laser_height: float, body_height: float
) -> bool:
    """Put a floor's tables into a store.

    Returns False if they are there already, whole.
    """
    key = _key(floor, raster_resolution, laser_height, body_height)
    if store.load(key) is not None:
        return False
    store.save(key, FloorTables.of_floor(floor, raster_resolution, laser_height, body_height).packed())
    return True


@lru_cache(maxsize=1)
def _cache(max_bytes: int) -> TablesCache:
    return TablesCache(max_bytes)


def _key(floor: Floor, raster_resolution: float, laser_height: float, body_height: float) -> str:
    numbers = " ".join(float(number).hex() for number in (raster_resolution, laser_height, body_height))
    return f"tables {floor.geometry_sha256} {numbers} {hash_of_code(*MADE_BY)}"
