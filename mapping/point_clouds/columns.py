"""Columns of a file that are points, normals and weights, by their names."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.point_clouds.point_cloud import PointCloud

POINTS = ("x", "y", "z")
NORMALS = (("normal_x", "normal_y", "normal_z"), ("nx", "ny", "nz"))
WEIGHT = "weight"


def wanted_columns(names: Sequence[str]) -> list[str]:
    """Return which columns of a file are read.

    Raises
    ------
    ValueError
        Where x, y or z is missing.
    """
    missing = [name for name in POINTS if name not in names]
    if missing:
        raise ValueError(f"it has no field {', '.join(missing)}, but {', '.join(names) or 'none'}")
    normals = next((each for each in NORMALS if all(name in names for name in each)), ())
    return [*POINTS, *normals, *([WEIGHT] if WEIGHT in names else [])]


def cloud_of_columns(columns: Mapping[str, NDArray[np.generic]], source: str) -> PointCloud:
    """Return the cloud of columns by their names.

    Parameters
    ----------
    columns : mapping of str to (N,) array
        Those that ``wanted_columns`` named.
    source : str
        The file.

    Returns
    -------
    PointCloud
        The cloud.
    """
    normals = next((each for each in NORMALS if each[0] in columns), None)
    return PointCloud(
        _stacked(columns, POINTS),
        None if WEIGHT not in columns else columns[WEIGHT].astype(np.float32),
        None if normals is None else _stacked(columns, normals),
        source,
    )


def _stacked(columns: Mapping[str, NDArray[np.generic]], names: Sequence[str]) -> NDArray[np.float32]:
    # What is above float32 becomes inf, and is refused with all that is not finite.
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([columns[name].astype(np.float32) for name in names], axis=1)


def text_columns(content: bytes, places: Sequence[int], rows: int | None = None) -> NDArray[np.float64]:
    """Return columns of lines of numbers.

    Parameters
    ----------
    content : bytes
        The lines; those that begin with ``#`` are passed over.
    places : sequence of int
        Which columns.
    rows : int, optional
        How many lines there have to be at least, of which no more are read; all by default.

    Returns
    -------
    (rows, columns) float64
        The numbers.

    Raises
    ------
    ValueError
        Where a line is no such numbers, there are fewer lines or none.
    """
    lines = [line for line in content.splitlines() if line.strip() and not line.lstrip().startswith(b"#")]
    if not lines:
        raise ValueError("it holds no points")
    if rows is not None and len(lines) < rows:
        raise ValueError(f"it claims {rows:,} points and holds {len(lines):,} lines: truncated")
    return np.loadtxt(lines[:rows], np.float64, usecols=places, ndmin=2, encoding="ascii")
