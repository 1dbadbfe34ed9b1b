"""Tables of the ray casters for one floor.

They hold the largest free squares and the faces of the walls.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.rays import BEHIND

TILE = 128
"""Side of the square tiles that group the faces [cells]."""

MAX_SQUARE = 255
"""Largest side of a free square that is kept [cells]: the maximum of a byte."""


@kernel
def _fill_squares(solid: Array, squares: Array) -> None:
    rows, columns = solid.shape
    beyond = np.zeros(columns, np.uint8)
    for quadrant in range(4):
        for i in range(rows):
            row = rows - 1 - i if quadrant & 2 == 0 else i
            cells, sides = solid[row], squares[quadrant, row]
            ahead = beyond if i == 0 else squares[quadrant, row + 1 if quadrant & 2 == 0 else row - 1]
            side, corner = 0, 0
            for j in range(columns):
                column = columns - 1 - j if quadrant & 1 == 0 else j
                above = int(ahead[column])
                smallest = min(min(above, corner), MAX_SQUARE - 1)
                side = min(side, smallest) + 1 if cells[column] == 0 else 0
                sides[column] = side
                corner = above


def _faces(solid: NDArray[np.uint8], tile_columns: int) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Return the group of each wall face and the faces (F, 3), for faces met along +x, -x, +y and -y.

    The group is tile * 4 + direction.
    """
    found = []
    for first in (0, 2):
        # Faces lie along lines; of those along y, the transposed raster holds the cells side by side.
        lines = np.ascontiguousarray(solid.T) if first == 0 else solid
        width = lines.shape[1]
        changes = np.flatnonzero(lines[:-1] != lines[1:])
        is_free = lines.ravel()[changes] == 0
        # The free cell is before the change if the face is met on the way up, otherwise behind it.
        for direction, cells in ((first, changes[is_free]), (first + 1, changes[~is_free] + width)):
            line, place = np.divmod(cells, width)
            begins = (np.diff(cells, prepend=-2) != 1) | (place % TILE == 0)
            ends = np.append(begins[1:], True)[: cells.size]
            line, low, high = line[begins], place[begins], place[ends] + 1
            row, column = (low, line) if first == 0 else (line, low)
            group = (row // TILE * tile_columns + column // TILE) * 4 + direction
            found.append((group, np.column_stack([line + (direction == first), low, high])))
    return found


class RayTables:
    """Lookup tables of the casters for one raster of solid cells.

    Shared by all episodes on that floor.

    Parameters
    ----------
    solid : (rows, columns) uint8
        1 if the world is solid; the outermost ring must be solid.

    Attributes
    ----------
    squares : (4, rows, columns) uint8
        Side of the largest free square that opens from the cell into each quadrant [cells]; 0 in solid cells.
    faces : (F, 3) int32
        Wall faces as fixed coordinate, low end and high end [cells], grouped by tile and direction.
    face_starts : (tiles * 4 + 1,) int32
        First face of each group.
    """

    def __init__(self, solid: NDArray[np.uint8]) -> None:
        if solid.ndim != 2 or min(solid.shape) < 3:
            raise ValueError(f"the raster of solid cells has shape {solid.shape}; want at least 3 rows and 3 columns")
        border = (solid[0], solid[-1], solid[:, 0], solid[:, -1])
        if not all(side.all() for side in border):
            raise ValueError("the outermost ring of the raster is not all solid; a ray could leave the floor")
        self.rows, self.columns = solid.shape
        # Rays that travel in lanes read whole words, a little further than the last square.
        room = np.zeros(4 * solid.size + BEHIND, np.uint8)
        self.squares: NDArray[np.uint8] = room[: 4 * solid.size].reshape(4, *solid.shape)
        _fill_squares(solid, self.squares)
        tile_rows, self.tile_columns = -(-self.rows // TILE), -(-self.columns // TILE)
        found = _faces(solid, self.tile_columns)
        groups = np.concatenate([group for group, _ in found])
        counts = np.bincount(groups + 1, minlength=tile_rows * self.tile_columns * 4 + 1)
        self.face_starts = np.cumsum(counts, dtype=np.int32)
        faces = np.concatenate([face for _, face in found])[np.argsort(groups, kind="stable")]
        # Never empty, so that it has an address.
        self.faces = np.ascontiguousarray(faces if faces.size else np.zeros((1, 3)), np.int32)

    @property
    def addresses(self) -> NDArray[np.int64]:
        """Row of the kernels' table of floors: addresses and sizes of the arrays."""
        return np.array(
            [
                self.squares.ctypes.data,
                self.rows,
                self.columns,
                self.faces.ctypes.data,
                self.faces.shape[0],
                self.face_starts.ctypes.data,
                self.face_starts.shape[0],
                self.tile_columns,
            ],
            np.int64,
        )
