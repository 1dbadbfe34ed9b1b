"""Places in strips of ground, so that few bits tell each from the one before.

Strips lie along x and are driven through in turn, one forth and the next one back. A place is its step along
the strip, its place across, by how many strips it is farther, and its height. Steps are short because
places of one strip are near each other; where a place lies across is one of few numbers.
"""

import numpy as np
from numpy.typing import NDArray

STRIP = 40
"""Width of a strip [steps]: narrower ones have longer steps, in wider ones more lies across."""

COLUMNS = 4


def strip_order(places: NDArray[np.int64], origin: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the order of places (N, 3) along the strips of an origin (3,), (N,)."""
    x, y, z = (places - origin).T
    strips = y // STRIP
    return np.lexsort((z, y, x * _directions(strips), strips))


def strip_columns(places: NDArray[np.int64], origin: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return ordered places (N, 3), none below the origin (3,), as columns (N, 4) that are not negative."""
    x, y, z = (places - origin).T
    strips = y // STRIP
    steps = np.diff(x, prepend=0) * _directions(strips)
    return np.stack([(steps << 1) ^ (steps >> 63), y % STRIP, np.diff(strips, prepend=0), z], axis=1)


def places_of_strips(columns: NDArray[np.int64], origin: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the places (N, 3) that `strip_columns` was given."""
    coded, across, farther, z = columns.T
    strips = np.cumsum(farther)
    x = np.cumsum(((coded >> 1) ^ -(coded & 1)) * _directions(strips))
    return np.stack([x, strips * STRIP + across, z], axis=1) + origin


def _directions(strips: NDArray[np.int64]) -> NDArray[np.int64]:
    return 1 - 2 * (strips % 2)
