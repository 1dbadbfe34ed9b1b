"""HouseExpo floors: one polygon in metres around the free interior.

References
----------
T. Li et al., HouseExpo: A Large-scale 2D Indoor Layout Dataset for Learning-based Algorithms on Mobile
Robots, IROS 2020.
"""

import json
from pathlib import Path

import numpy as np

from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.floors.importers.common import floor_name, read_text, refuse_resolution
from lidarium.mapping.files.guarded_reading import reading

_SURROUND = 1.0


def load(path: Path, resolution: float | None) -> Floor:
    """Read a HouseExpo file: everything outside of ``verts`` is solid."""
    refuse_resolution(path, resolution)
    text = read_text(path)
    with reading(path, "JSON"):
        house = json.loads(text)
    if not isinstance(house, dict) or "verts" not in house:
        raise ValueError(
            f"{path} has no key verts; want a HouseExpo file, with the corners of its free space in metres"
        )
    try:
        corners = np.asarray(house["verts"], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        corners = np.zeros((0, 2))
    if corners.ndim != 2 or corners.shape[0] < 3 or corners.shape[1] != 2 or not np.isfinite(corners).all():
        raise ValueError(f"{path}: verts has shape {corners.shape}; want at least 3 points (x, y) in metres")
    if np.array_equal(corners[0], corners[-1]):
        corners = corners[:-1]
    (x_low, y_low), (x_high, y_high) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    left, bottom, right, top = x_low - _SURROUND, y_low - _SURROUND, x_high + _SURROUND, y_high + _SURROUND
    around = np.array([[left, bottom], [right, bottom], [right, top], [left, top]])
    return Floor(floor_name(path), (x_low, y_low, x_high, y_high), (Solid(around, holes=(corners,)),))
