"""What quantisation gives: codes, and what is known of each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.quantisation.seeding import Nearest
from lidarium.mapping.sparse.quantisation.summary import summary_of
from lidarium.mapping.sparse.quantisation.tiles import Tiles


@dataclass(frozen=True, slots=True, eq=False)
class Quantisation:
    """Codes of a cloud.

    Attributes
    ----------
    codes : (k, 3) float64
        The codes, of which each is a float32 [m].
    labels : (N,) int32
        The nearest code of every point, in the caller's order; of equal ones that of the lowest number.
    counts : (k,) int64
        Points of each code.
    boxes : (k, 2, 3) float32
        Least and greatest coordinates of each code's points [m]; of no points, the code itself.
    normals : (k, 3) float64
        Unit vectors along which each code's points vary least, upwards; nan where fewer than three say.
    phi1 : float
        Mean distance of points to their codes [m], the thesis's equation 5.1.
    phi2 : float
        Mean squared distance [m2], what Lloyd's steps lower.
    rho : (k,) float32
        Radius of each code: greatest distance of its points [m].
    """

    codes: NDArray[np.float64]
    labels: NDArray[np.int32]
    counts: NDArray[np.int64]
    boxes: NDArray[np.float32]
    normals: NDArray[np.float64]
    phi1: float
    phi2: float
    rho: NDArray[np.float32]


def quantisation_of(tiles: Tiles, codes: NDArray[np.float32], nearest: Nearest) -> Quantisation:
    """Return the quantisation of points by codes whose nearest are known.

    Parameters
    ----------
    tiles : Tiles
        The points.
    codes : (k, 3) float32
        The codes [m].
    nearest : Nearest
        The nearest code of every point.

    Returns
    -------
    Quantisation
        Codes, labels and what is known of each code.
    """
    summary = summary_of(tiles, codes, nearest)
    is_empty = summary.counts == 0
    boxes = np.where(is_empty[:, None, None], codes[:, None], summary.boxes)
    phi1, phi2 = summary.errors.sum(axis=0) / summary.masses.sum()
    return Quantisation(
        codes.astype(np.float64),
        _in_order(nearest.labels.reshape(-1), tiles.order),
        summary.counts,
        boxes,
        _normals(summary.covariances(), summary.counts),
        float(phi1),
        float(phi2),
        summary.radii,
    )


@kernel
def _in_order(labels: Array, order: Array) -> Array:
    """Return labels of points in the caller's order."""
    placed = np.empty(len(order), np.int32)
    for place in range(len(order)):
        placed[order[place]] = labels[place]
    return placed


def _normals(covariances: NDArray[np.float64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the directions of least variance, with z, else y, else x above zero."""
    normals: NDArray[np.float64] = np.linalg.eigh(covariances)[1][:, :, 0]
    signs = np.sign(normals)
    up = np.where(signs[:, 2] != 0, signs[:, 2], np.where(signs[:, 1] != 0, signs[:, 1], signs[:, 0]))
    normals = normals * up[:, None]
    normals[counts < 3] = np.nan
    return normals
