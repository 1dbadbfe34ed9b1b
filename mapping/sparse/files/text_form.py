"""Sparse maps as the thesis writes them: a line of text for each code.

``# sparse-map v1 n_occ n_free``, then ``x y z`` [m] with six decimals: occupied codes, then free ones, both
in order of their distance to the map's origin. Boxes are not kept.

References
----------
Sparse mapper, section 4, step 4.
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.guarded_reading import read_text, reading
from lidarium.mapping.files.output import write_whole
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes

TITLE = "# sparse-map"
VERSION = "v1"
DECIMALS = 6
FARTHEST_M = 1e6
MOST_FILE_BYTES = 256 << 20
_LEAST_LINE = len("0 0 0")


def write_text(path: Path, sparse_map: SparseMap) -> None:
    """Write the codes of a map as text, whole or not at all.

    Raises
    ------
    ValueError
        Where coordinates are too large.
    OSError
        Where nothing can be written there.
    """
    write_whole(path, text_content(sparse_map).encode())


def text_content(sparse_map: SparseMap) -> str:
    """Return a map's codes as text."""
    occupied, free = _by_distance(sparse_map.centres), _by_distance(sparse_map.free)
    lines = [f"{TITLE} {VERSION} {len(occupied)} {len(free)}"]
    for x, y, z in np.concatenate([occupied, free]).tolist():
        lines.append(f"{x:.{DECIMALS}f} {y:.{DECIMALS}f} {z:.{DECIMALS}f}")
    return "\n".join(lines) + "\n"


def read_text_map(path: Path) -> SparseMap:
    """Read a map that was written as text: its boxes have no size, its floor is z = 0.

    Raises
    ------
    FileNotFoundError
        Where there is none.
    ValueError
        Where it is no such file, or has more or fewer codes than it claims.
    """
    text = read_text(path, MOST_FILE_BYTES)
    with reading(path, "a sparse map"):
        return parsed_text(text)


def parsed_text(text: str) -> SparseMap:
    """Return the map of a text."""
    head, _, rest = text.partition("\n")
    occupied_count, free_count = _counts(head)
    count = occupied_count + free_count
    if count * (_LEAST_LINE + 1) > len(rest) + 1:
        raise ValueError(f"it claims {count:,} codes; {len(rest):,} letters cannot hold them")
    lines = rest.splitlines()
    if len(lines) != count:
        raise ValueError(f"it claims {count:,} codes; there are {len(lines):,} lines")
    points = np.empty((count, 3))
    for place, line in enumerate(lines):
        points[place] = _point(line, place + 2)
    occupied = points[:occupied_count]
    return SparseMap(
        occupied=occupied_codes(np.stack([occupied, occupied], axis=1)),
        ground=free_codes(points[occupied_count:]),
        settings=MapperSettings(mode="thesis"),
    )


def _counts(head: str) -> tuple[int, int]:
    """Return how many occupied and free codes the first line claims."""
    words = head.split()
    if words[:2] != TITLE.split() or len(words) != 5:
        raise ValueError(f"it begins with {head[:60]!r}; want '{TITLE} {VERSION} n_occ n_free'")
    if words[2] != VERSION:
        raise ValueError(f"it is of version {words[2][:20]!r}; want {VERSION}")
    if not all(word.isascii() and word.isdigit() and len(word) <= 9 for word in words[3:]):
        raise ValueError(f"its counts are {' '.join(words[3:])[:60]!r}; want two whole numbers")
    return int(words[3]), int(words[4])


def _point(line: str, number: int) -> tuple[float, float, float]:
    words = line.split()
    try:
        x, y, z = map(float, words)
    except ValueError:
        raise ValueError(f"line {number} is {line[:60]!r}; want three numbers x y z") from None
    if not all(math.isfinite(value) and abs(value) <= FARTHEST_M for value in (x, y, z)):
        raise ValueError(f"line {number} is {line[:60]!r}; want numbers within {FARTHEST_M:,.0f} m")
    return x, y, z


def _by_distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sort points (N, 3) by their distance to the origin; equal ones stay in order."""
    if not (np.abs(points) <= FARTHEST_M).all():
        raise ValueError(f"a coordinate of the map is not within {FARTHEST_M:,.0f} m; want metres")
    return points[np.argsort(np.linalg.norm(points, axis=1), kind="stable")]
