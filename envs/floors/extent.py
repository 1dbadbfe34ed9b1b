"""How large a floor may be, so that its rasters can be drawn in time and memory that there are."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

MOST_COORDINATE_M = 1e8
"""Farthest that a floor may lie from the origin of its frame [m]."""

MOST_EXTENT_M = 10_000.0
"""Longest side of a floor [m]."""

MOST_BEYOND_M = 1_000.0
"""Farthest that what stands there may reach beyond the bounds [m]."""

MOST_OUTLINE_M = 500_000.0
"""Longest sum of all outlines: each is followed cell by cell [m]."""

MOST_PAIRS = 250_000
"""Most walls times doors: each is compared with each."""

MOST_CORNERS = 2_000_000
"""Most corners of all outlines."""


def check_extent(what: str, bounds: Iterable[float], rings: Iterable[NDArray[np.float64]] = ()) -> None:
    """Check that a floor is not too large.

    Parameters
    ----------
    what : str
        The floor, for messages.
    bounds : (x_min, y_min, x_max, y_max)
        Rectangle that holds it [m].
    rings : iterable of (N, 2) float64
        Closed outlines of what stands there [m].

    Raises
    ------
    ValueError
        Where it is; the message says how.
    """
    low_x, low_y, high_x, high_y = bounds
    side, farthest = max(high_x - low_x, high_y - low_y), max(map(abs, (low_x, low_y, high_x, high_y)))
    if not (side <= MOST_EXTENT_M and farthest <= MOST_COORDINATE_M):
        raise ValueError(
            f"{what} has a side of {side:g} m, up to {farthest:g} m from its origin; want at most "
            f"{MOST_EXTENT_M:,.0f} m, up to {MOST_COORDINATE_M:,.0f} m: check its scale"
        )
    outlines = [np.asarray(ring, np.float64) for ring in rings if len(ring)]
    if not outlines:
        return
    corners = np.concatenate(outlines)
    if not (
        (corners >= [low_x - MOST_BEYOND_M, low_y - MOST_BEYOND_M]).all()
        and (corners <= [high_x + MOST_BEYOND_M, high_y + MOST_BEYOND_M]).all()
    ):
        raise ValueError(
            f"{what} has something that stands more than {MOST_BEYOND_M:,.0f} m beyond its bounds; want "
            "all of it within: check its scale"
        )
    ends = np.cumsum([len(ring) for ring in outlines])
    following = np.arange(1, len(corners) + 1)
    following[ends - 1] = np.concatenate([[0], ends[:-1]])
    steps = corners[following] - corners
    if len(corners) > MOST_CORNERS or float(np.hypot(steps[:, 0], steps[:, 1]).sum()) > MOST_OUTLINE_M:
        raise ValueError(
            f"{what} has more than {MOST_CORNERS:,} corners or {MOST_OUTLINE_M:,.0f} m of walls; want "
            "fewer: check its scale, or part it"
        )


def check_pairs(what: str, walls: int, doors: int) -> None:
    """Check that comparing all walls with all doors does not take too long.

    Raises
    ------
    ValueError
        Where it would.
    """
    if walls * doors > MOST_PAIRS:
        raise ValueError(f"{what} has {walls:,} walls and {doors:,} doors; want a product of {MOST_PAIRS:,}")
