"""Contents of files of clouds: columns of points, normals and weights, and faces."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.point_clouds.faces import Triangles

POINTS = ("x", "y", "z")
NORMALS = (("normal_x", "normal_y", "normal_z"), ("nx", "ny", "nz"))
WEIGHT = "weight"


def wanted_columns(names: Sequence[str]) -> list[str]:
    """Return which columns of a file are read."""
    missing = [name for name in POINTS if name not in names]
    if missing:
        raise ValueError(f"it has no field {', '.join(missing)}, but {', '.join(names) or 'none'}")
    normals = next((each for each in NORMALS if all(name in names for name in each)), ())
    return [*POINTS, *normals, *([WEIGHT] if WEIGHT in names else [])]


@dataclass(frozen=True, slots=True)
class Content:
    """Content of a file: points (N, 3) in the precision that they have there, their weights, normals and triangles."""

    points: NDArray[np.floating]
    weights: NDArray[np.float32] | None = None
    normals: NDArray[np.float32] | None = None
    triangles: Triangles = field(default_factory=lambda: np.zeros((0, 3), np.int64))
    remarks: tuple[str, ...] = ()


def cloud_of_columns(columns: Mapping[str, NDArray[np.generic]]) -> Content:
    """Return the content of columns by their names.

    Parameters
    ----------
    columns : mapping of str to (N,) array
        Those that ``wanted_columns`` named.
    """
    normals = next((each for each in NORMALS if each[0] in columns), None)
    is_single = all(columns[name].dtype.newbyteorder("=") == np.float32 for name in POINTS)
    return Content(
        _stacked(columns, POINTS, np.float32 if is_single else np.float64),
        None if WEIGHT not in columns else columns[WEIGHT].astype(np.float32),
        None if normals is None else _stacked(columns, normals, np.float32),
    )


def _stacked(
    columns: Mapping[str, NDArray[np.generic]], names: Sequence[str], kind: type[np.floating]
) -> NDArray[np.floating]:
    # What is above the type becomes inf, and is refused with all that is not finite.
    with np.errstate(over="ignore", invalid="ignore"):
        return np.stack([columns[name].astype(kind) for name in names], axis=1)


def text_columns(content: bytes, places: Sequence[int], rows: int | None = None) -> NDArray[np.float64]:
    """Return columns of lines of numbers, all of which have as many: in a damaged line others are x, y and z.

    Returns
    -------
    (rows, columns) float64
        The numbers.
    """
    lines = [line for line in content.splitlines() if line.strip() and not line.lstrip().startswith(b"#")]
    if not lines:
        raise ValueError("it holds no points")
    if rows is not None and len(lines) < rows:
        raise ValueError(f"it claims {rows:,} points and holds {len(lines):,} lines: truncated")
    counts = np.array([len(line.partition(b"#")[0].split()) for line in lines[:rows]])
    usual = int(np.bincount(counts).argmax())
    others = np.flatnonzero(counts != usual)
    if len(others):
        first = lines[others[0]][:60].decode("ascii", "replace")
        raise ValueError(
            f"{len(others):,} of its {len(counts):,} lines of numbers have not {usual} columns as most: damaged? The "
            f"first is {first!r}"
        )
    return np.loadtxt(lines[:rows], np.float64, usecols=places, ndmin=2, encoding="ascii")
