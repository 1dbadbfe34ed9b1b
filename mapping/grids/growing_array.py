"""Arrays that grow row by row."""

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


class GrowingArray:
    """Rows in one piece of memory, which is doubled if it is full.

    Parameters
    ----------
    shape : tuple of int
        Shape of a row.
    dtype : dtype
        Type of its numbers.
    """

    def __init__(self, shape: tuple[int, ...], dtype: DTypeLike) -> None:
        self._room = np.empty((16, *shape), dtype)
        self._count = 0

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._count

    def append(self, row: Any) -> None:  # noqa: ANN401
        """Add a copy of a row; raise ValueError if its shape is another one."""
        if np.shape(row) != self._room.shape[1:]:
            raise ValueError(f"row has shape {np.shape(row)}; want {self._room.shape[1:]}")
        if self._count == len(self._room):
            room = np.empty((2 * self._count, *self._room.shape[1:]), self._room.dtype)
            room[: self._count] = self._room
            self._room = room
        self._room[self._count] = row
        self._count += 1

    @property
    def rows(self) -> NDArray[Any]:
        """All rows so far, shape (rows, ...): a view that later rows do not change."""
        return self._room[: self._count]
