"""Doors of a map: the gaps through which its regions of free space meet."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.merging.regions.meetings import Meetings

_WIDE_PART = 0.7
"""The middle of a door is that of the edges with so much of its most clearance."""


class Doors(NamedTuple):
    """Gaps between regions, (n,).

    Attributes
    ----------
    regions : (n, 2) int64
        The regions on both sides; one pair may have several doors.
    places : (n, 2) float64
        Middle of the gap, in the map's frame [m].
    normals : (n,) float64
        Direction through it, from the first region to the second [rad].
    widths : (n,) float64
        Width of the gap [m].
    """

    regions: NDArray[np.int64]
    places: NDArray[np.float64]
    normals: NDArray[np.float64]
    widths: NDArray[np.float64]


def find_doors(met: Meetings, side: float) -> Doors:
    """Return the doors of a map, those between the first regions first.

    Parameters
    ----------
    met : Meetings
        Edges between cells of two regions.
    side : float
        Side of a cell [m].
    """
    is_turned = met.regions[:, 0] > met.regions[:, 1]
    pairs = np.sort(met.regions, axis=1).astype(np.int64)
    steps = np.where(is_turned[:, None], -met.steps, met.steps)
    regions, places, normals, widths = [], [], [], []
    for pair in np.unique(pairs, axis=0):
        chosen = np.flatnonzero((pairs == pair).all(axis=1))
        parts = _connected(met.places[chosen])
        for part in range(parts.max() + 1):
            edges = chosen[parts == part]
            most = met.clearance[edges].max()
            middle = met.places[edges[met.clearance[edges] >= _WIDE_PART * most]].mean(axis=0)
            through = steps[edges].sum(axis=0)
            regions.append(pair)
            places.append(middle * side)
            normals.append(np.arctan2(through[1], through[0]))
            # Clearance is that of a cell's middle: half a cell more or less on average.
            widths.append((2.0 * most - 0.5) * side)
    return Doors(
        np.array(regions, np.int64).reshape(-1, 2),
        np.array(places).reshape(-1, 2),
        np.array(normals, np.float64),
        np.array(widths, np.float64),
    )


def _connected(places: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the number of the connected part to which each edge belongs, (n,)."""
    # Middles of edges lie on a grid of half cells; those of neighbouring cells are at most two apart.
    points = np.rint(2.0 * places).astype(np.int64)
    columns, rows = (points - points.min(axis=0) + 2).T
    drawn = np.zeros((rows.max() + 3, columns.max() + 3), np.uint8)
    drawn[rows, columns] = 1
    _, parts = cv2.connectedComponents(cv2.dilate(drawn, np.ones((3, 3), np.uint8)), connectivity=8)
    return np.asarray(parts[rows, columns], np.int64) - 1
