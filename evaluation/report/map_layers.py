"""Maps over time as the page shows them, and how whole numbers and maps are packed into few bytes.

``evaluation/report/web/src/replay/unpacking.ts`` reads them.
"""

import base64
import functools
import json
import math
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_BITS, _MOST_BYTES = 7, 5


def varints(values: ArrayLike) -> bytes:
    """Return whole numbers from 0 to 2^35 - 1 in groups of seven bits, the lowest first (LEB128)."""
    numbers = np.asarray(values, np.uint64).ravel()
    groups = (numbers[:, None] >> np.arange(0, _BITS * _MOST_BYTES, _BITS, dtype=np.uint64)) & np.uint64(127)
    sizes = np.ones(len(numbers), np.int64)
    for size in range(1, _MOST_BYTES):
        sizes[numbers >= 1 << (_BITS * size)] = size + 1
    places = np.arange(_MOST_BYTES)
    groups |= np.where(places < sizes[:, None] - 1, np.uint64(128), np.uint64(0))
    return groups[places < sizes[:, None]].astype(np.uint8).tobytes()


def signed_varints(values: ArrayLike) -> bytes:
    """Return whole numbers with a sign as `varints`: 0, -1, 1, -2 and so on become 0, 1, 2, 3."""
    numbers = np.asarray(values, np.int64).ravel()
    return varints((numbers << 1) ^ (numbers >> 63))


def changed_runs(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> bytes:
    """Return the changes from one map to another of the same shape, as runs of cells with one new value.

    The number of runs; then of each the cells that are skipped, the cells that it has, and their value.
    """
    old, new = before.ravel(), after.ravel()
    cells = np.flatnonzero(old != new)
    if not len(cells):
        return varints([0])
    values = new[cells].astype(np.int64)
    first = np.flatnonzero(np.r_[True, (np.diff(cells) != 1) | (np.diff(values) != 0)])
    lengths = np.diff(np.r_[first, len(cells)])
    starts = cells[first]
    skipped = starts - np.r_[0, (starts + lengths)[:-1]]
    return varints(np.r_[len(first), np.stack([skipped, lengths, values[first]], axis=1).ravel()])


def packed(header: Mapping[str, Any], streams: Mapping[str, bytes]) -> str:
    """Return a header and named streams as text: base64 of deflated bytes.

    Before that: the size of the header in bytes (4 bytes, lowest first), the header as JSON with the names and
    sizes of the streams, and the streams one after the other.
    """
    whole = {**header, "streams": [[name, len(stream)] for name, stream in streams.items()]}
    text = json.dumps(whole, allow_nan=False, separators=(",", ":")).encode()
    content = b"".join([struct.pack("<I", len(text)), text, *streams.values()])
    return base64.b64encode(zlib.compress(content, 9)).decode()


UNKNOWN, FREE, OCCUPIED = 0, 1, 2
"""Levels of a cell of the page."""

FINEST_M = 0.05
"""Minimum side of a cell of the page [m]."""

MOST_CELLS = 250_000
"""Maximum number of cells of a map of the page; larger maps get larger cells."""

_MARGIN_M = 0.15

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Grid:
    """Which part of a lattice the page shows, and how coarsely.

    Attributes
    ----------
    row, column : int
        First cell of the lattice.
    rows, columns : int
        Size in cells of the page.
    block : int
        Cells of the lattice along the side of a cell of the page.
    """

    row: int
    column: int
    rows: int
    columns: int
    block: int

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the lattice."""
        return (
            slice(self.row, self.row + self.rows * self.block),
            slice(self.column, self.column + self.columns * self.block),
        )

    def header(self, origin: tuple[float, float], resolution: float) -> dict[str, float]:
        """Return the header for the page: size, lower left corner and side of a cell [m]."""
        return {
            "rows": self.rows,
            "columns": self.columns,
            "x": round(float(origin[0]) + self.column * resolution, 6),
            "y": round(float(origin[1]) + self.row * resolution, 6),
            "cell": round(self.block * resolution, 9),
        }


def grid_around(shown: Mask, resolution: float) -> Grid:
    """Return the grid that shows all cells of a lattice that are set, with a margin."""
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    if not len(rows):
        rows, columns = np.array([0]), np.array([0])
    margin = math.ceil(_MARGIN_M / resolution)
    sides = []
    for cells, size in ((rows, shown.shape[0]), (columns, shown.shape[1])):
        sides.append((max(int(cells[0]) - margin, 0), min(int(cells[-1]) + 1 + margin, size)))
    (row, end_row), (column, end_column) = sides
    area = (end_row - row) * (end_column - column)
    block = max(math.ceil(FINEST_M / resolution - 1e-9), math.ceil(math.sqrt(area / MOST_CELLS)))
    return Grid(row, column, max((end_row - row) // block, 1), max((end_column - column) // block, 1), block)


def coarse(occupied: Mask, free: Mask, block: int) -> NDArray[np.uint8]:
    """Return levels of blocks: occupied if any cell is, otherwise free if any is, otherwise unknown."""
    levels = occupied.view(np.uint8) * np.uint8(OCCUPIED)
    np.maximum(levels, free.view(np.uint8), out=levels)
    rows, columns = (side // block for side in levels.shape)
    # Rows first: they are whole and therefore quick, and leave fewer cells for the columns.
    for axis, size in ((0, rows), (1, columns)):
        parts = [levels.swapaxes(0, axis)[k : size * block : block] for k in range(block)]
        levels = functools.reduce(np.maximum, parts).swapaxes(0, axis)
    return np.ascontiguousarray(levels)


@dataclass(slots=True)
class Layer:
    """A map over time, as the changes from each sample to the next; it begins unknown.

    Attributes
    ----------
    levels : (rows, columns) uint8
        The map as of the last sample.
    changes : bytearray
        `changed_runs` of all samples.
    """

    levels: NDArray[np.uint8]
    changes: bytearray = field(default_factory=bytearray)

    @classmethod
    def blank(cls, grid: Grid) -> "Layer":
        """Return a layer of which nothing is known."""
        return cls(np.zeros((grid.rows, grid.columns), np.uint8))

    def add(self, levels: NDArray[np.uint8]) -> None:
        """Add a sample."""
        self.changes += changed_runs(self.levels, levels)
        self.levels = levels
