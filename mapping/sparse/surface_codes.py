"""Codes spread evenly over the surfaces of a map, for registration.

A box that many codes were merged into says as much of its plane as all of them did. So it is taken as
points on the plane through its middle, where all of them lay on one. Of clutter a merged map says less than
the codes did: to be registered, maps are made with ``merges=False``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.sparse.sparse_map import SparseMap

SPACING_M = 0.25
"""How far apart the points of a surface are, about [m]."""

_LEAST_MARGIN_M = 0.02


class Codes(NamedTuple):
    """Codes with the surfaces they lie on.

    Attributes
    ----------
    centres : (N, 3) float64
        Codes [m].
    normals : (N, 3) float64
        Unit normals, either way round; zero where there is none.
    weights : (N,) float64
        Weights.
    """

    centres: NDArray[np.float64]
    normals: NDArray[np.float64]
    weights: NDArray[np.float64]


def codes_of(sparse_map: SparseMap, spacing: float = SPACING_M) -> Codes:
    """Return the codes of a map, of what is occupied and of the floor.

    Parameters
    ----------
    sparse_map : SparseMap
        The map.
    spacing : float
        How far apart the points of a wide code are, at most [m].

    Returns
    -------
    Codes
        Points on the planes of the occupied codes, then the free codes.
    """
    spread = _spread(sparse_map, spacing)
    count = len(sparse_map.ground)
    typical = float(np.mean(spread.weights)) if len(spread.weights) else 1.0
    return Codes(
        np.concatenate([spread.centres, sparse_map.free]),
        np.concatenate([spread.normals, np.tile(sparse_map.floor.normal, (count, 1))]),
        np.concatenate([spread.weights, np.full(count, typical)]),
    )


def _spread(sparse_map: SparseMap, spacing: float) -> Codes:
    """Spread the occupied codes over their planes, and their weights with them."""
    boxes, centres, normals = sparse_map.boxes, sparse_map.centres, sparse_map.normals
    sizes = boxes[:, 1] - boxes[:, 0]
    facing = np.abs(normals).argmax(axis=1)
    counts = np.maximum(np.ceil(sizes / spacing).astype(np.int64), 1)
    counts[np.arange(len(boxes)), facing] = 1
    counts[~normals.any(axis=1)] = 1
    totals = counts.prod(axis=1)
    codes = np.repeat(np.arange(len(boxes)), totals)
    places = np.arange(len(codes)) - np.repeat(np.cumsum(totals) - totals, totals)
    steps = np.empty((len(codes), 3))
    for axis in range(3):
        steps[:, axis] = places % counts[codes, axis]
        places = places // counts[codes, axis]
    points = boxes[codes, 0] + (steps + 0.5) / counts[codes] * sizes[codes]
    is_alone = totals[codes] == 1
    points[is_alone] = centres[codes[is_alone]]
    # Along the axis that the surface faces, points are moved onto its plane.
    rows, axes = np.arange(len(codes)), facing[codes]
    slopes = normals[codes, axes]
    away = np.einsum("ij,ij->i", points - centres[codes], normals[codes])
    points[rows, axes] -= np.divide(away, slopes, out=np.zeros(len(codes)), where=slopes != 0.0)
    margin = _LEAST_MARGIN_M
    inside = ((points >= boxes[codes, 0] - margin) & (points <= boxes[codes, 1] + margin)).all(axis=1)
    weights = sparse_map.occupied.weights[codes] / totals[codes]
    return Codes(points[inside], normals[codes[inside]], weights[inside])
