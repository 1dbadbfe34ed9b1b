"""Outlines cut up into convex pieces."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.drawing import ring_edges

_FLAT = 1e-9
"""Height of a slab that is left out [m]."""


def convex_pieces(
    polygon: NDArray[np.float64], holes: tuple[NDArray[np.float64], ...] = ()
) -> list[NDArray[np.float64]]:
    """Return convex outlines that together cover a polygon without its holes.

    A convex polygon is its own piece. Others are cut along the y of each corner into trapezoids.

    Parameters
    ----------
    polygon : (N, 2) float64
        Corners in order [m].
    holes : tuple of (M, 2) float64
        Rings that are left out [m].
    """
    if not holes and _is_convex(polygon):
        return [polygon]
    edges = np.concatenate([ring_edges(ring) for ring in (polygon, *holes)])
    levels = np.unique(edges[:, [1, 3]])
    pieces = []
    for low, high in pairwise(levels):
        if high - low > _FLAT:
            pieces += _trapezoids(edges, low, high)
    return pieces


def _is_convex(polygon: NDArray[np.float64]) -> bool:
    sides = np.roll(polygon, -1, axis=0) - polygon
    after = np.roll(sides, -1, axis=0)
    turns = sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]
    # An outline that turns more than once around crosses itself.
    total = np.arctan2(turns, (sides * after).sum(axis=1)).sum()
    return bool(((turns >= 0.0).all() or (turns <= 0.0).all()) and abs(total) < 3.0 * np.pi)


def _trapezoids(edges: NDArray[np.float64], low: float, high: float) -> list[NDArray[np.float64]]:
    """Return what is inside of edges x1, y1, x2, y2 between two heights that no corner lies between."""
    crosses = (edges[:, [1, 3]].min(axis=1) <= low) & (edges[:, [1, 3]].max(axis=1) >= high)
    x1, y1, x2, y2 = edges[crosses].T
    at_low, at_high = (x1 + (level - y1) * (x2 - x1) / (y2 - y1) for level in (low, high))
    order = np.argsort(at_low + at_high, kind="stable")
    return [
        np.array([(at_low[a], low), (at_low[b], low), (at_high[b], high), (at_high[a], high)])
        for a, b in zip(order[0::2], order[1::2], strict=True)
    ]
