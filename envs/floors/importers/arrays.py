"""Numpy arrays as floors: grey levels (KTH floors of MapEx) or solid cells."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.floor import Floor
from lidarium.envs.floors.importers.common import floor_of_cells, refuse_resolution
from lidarium.mapping.files.guarded_reading import read_arrays
from lidarium.mapping.files.map_files import RESOLUTION
from lidarium.mapping.geometry.bounds import shown

_FREE_ABOVE = 127


def has_scale(path: Path) -> bool:
    """Whether an array states its scale: archives do, single arrays do not."""
    return path.suffix.lower() == ".npz"


def load(path: Path, resolution: float | None) -> Floor:
    """Read an array.

    ``.npy`` is an image, row 0 at the top: grey levels (above 127 is free) or booleans (true is solid); it needs a
    resolution. ``.npz`` holds ``solid`` (row 0 at the lowest y), ``origin`` (x, y) and ``resolution`` [m].
    """
    content = read_arrays(path, "a numpy array that can be read")
    if isinstance(content, dict):
        return _load_named(path, content, resolution)
    return floor_of_array(content, resolution, path)


def floor_of_array(array: NDArray[Any], resolution: float | None, path: Path = Path("array")) -> Floor:
    """Return the floor of an image, row 0 at the top: grey levels (above 127 is free) or booleans (true is solid)."""
    if resolution is None:
        raise ValueError(
            f"{path} is an array without a scale; want image_resolution (--resolution), its metres per cell"
        )
    _check_grid(path, array)
    free = ~array if array.dtype == np.bool_ else array > _FREE_ABOVE
    return floor_of_cells(path, np.ascontiguousarray(free[::-1]), (0.0, 0.0), resolution)


def _load_named(path: Path, named: dict[str, NDArray[np.generic]], resolution: float | None) -> Floor:
    missing = [name for name in ("solid", "origin", "resolution") if name not in named]
    if missing:
        raise ValueError(f"{path} has no array {', '.join(missing)}; want solid, origin and resolution")
    refuse_resolution(path, resolution)
    _check_grid(path, named["solid"])
    origin = np.asarray(named["origin"], dtype=np.float64).ravel()
    side = np.asarray(named["resolution"], dtype=np.float64).ravel()
    if origin.size != 2 or not np.isfinite(origin).all() or side.size != 1 or not RESOLUTION.hold(side[0]):
        raise ValueError(
            f"{path} has origin {shown(origin)} and resolution {shown(side)}; want (x, y) in metres and "
            f"{RESOLUTION.wanted}"
        )
    return floor_of_cells(path, named["solid"] == 0, (float(origin[0]), float(origin[1])), float(side[0]))


def _check_grid(path: Path, grid: NDArray[np.generic]) -> None:
    if grid.ndim != 2 or grid.size == 0 or grid.dtype.kind not in "buif":
        raise ValueError(f"{path} has shape {grid.shape} of {grid.dtype}; want rows and columns of numbers")
