"""Codes of a map become fewer: boxes merge, free codes merge.

Codes of several frames that merge belong to the frame with the most points.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.sparse.mapper.code_boxes import masses_of
from lidarium.mapping.sparse.mapper.merging import merged_boxes
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import OccupiedCodes

LEAST_AGREEMENT = 0.9
"""Mean square of the cosine between the normals of codes and that of all of them."""

FLATNESS_M = 0.03
"""How far codes may lie from a common plane, root of the mean square [m]."""


def merged_codes(
    codes: OccupiedCodes, free: NDArray[np.float64], settings: MapperSettings
) -> tuple[OccupiedCodes, NDArray[np.int64]]:
    """Merge codes whose boxes add nothing to each other.

    Parameters
    ----------
    codes : OccupiedCodes
        Codes, all where they are now.
    free : (N, 3) float64
        Free codes [m]: boxes do not grow over them.
    settings : MapperSettings
        How far unions may reach, and how many boxes there may be.

    Returns
    -------
    OccupiedCodes
        Codes whose boxes cover what was covered.
    (K,) int64
        Which code each of them is; -1 for those of several.
    """
    if len(codes) == 0 or not settings.merges:
        return codes, np.arange(len(codes))
    boxes, labels = merged_boxes(codes.boxes, free, settings.slack_m, settings.most_boxes)
    count = len(boxes)
    weights = masses_of(labels, codes.weights, count)
    centres = np.stack(
        [np.bincount(labels, codes.weights * codes.centres[:, axis], count) for axis in range(3)], axis=1
    )
    # The last of each group in this order is its heaviest.
    order = np.lexsort((codes.weights, labels))
    heaviest = order[np.searchsorted(labels[order], np.arange(count), side="right") - 1]
    merged = OccupiedCodes(
        boxes=boxes,
        centres=centres / np.maximum(weights, 1e-12)[:, None],
        weights=weights,
        normals=_common_normals(codes, labels, centres / np.maximum(weights, 1e-12)[:, None]),
        frames=codes.frames[heaviest],
    )
    return merged, np.where(np.bincount(labels, minlength=count) == 1, heaviest, -1)


def _common_normals(
    codes: OccupiedCodes, labels: NDArray[np.int64], centres: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the normals of merged codes, zero where they share no plane."""
    count = len(centres)
    products = np.einsum("n,ni,nj->nij", codes.weights, codes.normals, codes.normals).reshape(-1, 9)
    sums = np.stack([np.bincount(labels, part, count) for part in products.T], axis=1).reshape(-1, 3, 3)
    values, vectors = np.linalg.eigh(sums)
    normals = vectors[:, :, 2]
    largest = np.take_along_axis(normals, np.abs(normals).argmax(axis=1)[:, None], axis=1)
    normals = normals * np.where(largest < 0.0, -1.0, 1.0)
    weights = np.maximum(masses_of(labels, codes.weights, count), 1e-12)
    gaps = np.einsum("ij,ij->i", codes.centres - centres[labels], normals[labels])
    is_plane = np.bincount(labels, codes.weights * gaps**2, count) <= weights * FLATNESS_M**2
    normals[~(is_plane & (values[:, 2] >= LEAST_AGREEMENT * weights))] = 0.0
    return np.asarray(normals)
