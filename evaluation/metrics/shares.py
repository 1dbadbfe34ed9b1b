"""Shares of cells, which most metrics are made of."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
"""Which cells of a grid are meant, (rows, columns) bool."""


def share(part: NDArray[Any], whole: NDArray[Any], empty: float = 1.0) -> float:
    """Return ``|part| / |whole|``, the cells of which are those that are not 0.

    ``empty`` where the whole has none.
    """
    size = int(np.count_nonzero(whole))
    return int(np.count_nonzero(part)) / size if size else empty
