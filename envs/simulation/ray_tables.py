"""What the ray casters look up for one floor: the largest free squares, and the faces of the walls."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels import Array, kernel

TILE = 128
"""Side of the square tiles that group the faces [cells]."""

MAX_SQUARE = 255
"""Largest side of a free square that is told [cells]: what a byte holds."""


@kernel
def _fill_squares(solid: Array, squares: Array) -> None:
    rows, columns = solid.shape
    for quadrant in range(4):
        step_column = 1 if quadrant & 1 == 0 else -1
        step_row = 1 if quadrant & 2 == 0 else -1
        for i in range(rows):
            row = rows - 1 - i if step_row > 0 else i
            for j in range(columns):
                column = columns - 1 - j if step_column > 0 else j
                if solid[row, column] != 0:
                    squares[quadrant, row, column] = 0
                    continue
                next_row = row + step_row
                next_column = column + step_column
                side = 0
                if 0 <= next_row < rows and 0 <= next_column < columns:
                    side = min(
                        squares[quadrant, next_row, column],
                        squares[quadrant, row, next_column],
                        squares[quadrant, next_row, next_column],
                    )
                squares[quadrant, row, column] = min(side + 1, MAX_SQUARE)


@kernel
def _count_or_list_faces(solid: Array, tile_columns: int, starts: Array, faces: Array, listing: bool) -> None:
    """Count the faces of each (tile, direction) in ``starts[1:]``, or list them from ``starts`` on."""
    rows, columns = solid.shape
    for direction in range(4):
        along_rows = direction < 2
        step = 1 if direction & 1 == 0 else -1
        fixed_count = columns if along_rows else rows
        run_count = rows if along_rows else columns
        for fixed in range(fixed_count):
            behind = fixed + step
            if behind < 0 or behind >= fixed_count:
                continue
            run_start = -1
            for k in range(run_count + 1):
                is_face = False
                if k < run_count:
                    if along_rows:
                        is_face = solid[k, fixed] == 0 and solid[k, behind] != 0
                    else:
                        is_face = solid[fixed, k] == 0 and solid[behind, k] != 0
                if run_start >= 0 and (not is_face or k % TILE == 0):
                    tile = (run_start // TILE) * tile_columns + fixed // TILE
                    if not along_rows:
                        tile = (fixed // TILE) * tile_columns + run_start // TILE
                    group = tile * 4 + direction
                    if listing:
                        place = starts[group]
                        faces[place, 0] = fixed + (1 if step > 0 else 0)
                        faces[place, 1] = run_start
                        faces[place, 2] = k
                        starts[group] += 1
                    else:
                        starts[group + 1] += 1
                    run_start = -1
                if is_face and run_start < 0:
                    run_start = k


class RayTables:
    """What the casters look up for one raster of solid cells; shared by all episodes on that floor.

    Parameters
    ----------
    solid : (rows, columns) uint8
        1 where the world is solid; the outermost ring must be solid.

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
        self.squares = np.empty((4, *solid.shape), np.uint8)
        _fill_squares(solid, self.squares)
        tile_rows, self.tile_columns = -(-self.rows // TILE), -(-self.columns // TILE)
        counts = np.zeros(tile_rows * self.tile_columns * 4 + 1, np.int32)
        _count_or_list_faces(solid, self.tile_columns, counts, np.empty((0, 3), np.int32), False)
        self.face_starts = np.cumsum(counts, dtype=np.int32)
        self.faces = np.empty((max(int(self.face_starts[-1]), 1), 3), np.int32)
        _count_or_list_faces(solid, self.tile_columns, self.face_starts[:-1].copy(), self.faces, True)

    @property
    def addresses(self) -> NDArray[np.int64]:
        """Row of the kernels' table of floors: where the arrays lie, and their sizes."""
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
