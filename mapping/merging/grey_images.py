"""Corners of grey images: edges for the corner table, and the detector of Trajkovic and Hedley.

Photographs and other grey images have no three levels. The thesis puts a Sobel edge extractor before its
detector, and compares with that of Trajkovic and Hedley.

References
----------
M. Trajkovic, M. Hedley, "Fast corner detection", Image and Vision Computing 16, 1998.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED

EDGE_SHARE = 0.25
"""Share of the strongest edge from which a pixel is one."""


def edge_levels(image: NDArray[np.uint8], least_share: float = EDGE_SHARE) -> NDArray[np.uint8]:
    """Return a grey image as a map: edges are occupied, all else is free.

    Parameters
    ----------
    image : (rows, columns) uint8
        The image.
    least_share : float
        Share of the largest gradient of the image (Sobel, 3 x 3) from which a pixel is an edge, 0 to 1.

    Raises
    ------
    ValueError
        If the image has no rows and columns of one grey each, or the share is none.
    """
    _check(image)
    if not 0.0 < least_share <= 1.0:
        raise ValueError(f"the share of edges is {least_share}; want a number above 0 and up to 1")
    across, along = (cv2.Sobel(image, cv2.CV_32F, *order, ksize=3) for order in ((1, 0), (0, 1)))
    gradient = np.hypot(across, along)
    strongest = float(gradient.max())
    is_edge = (gradient >= least_share * strongest) & (gradient > 0.0)
    return np.where(is_edge, OCCUPIED, FREE).astype(np.uint8)


def trajkovic_corners(image: NDArray[np.uint8], first_threshold: float, second_threshold: float) -> NDArray[np.int64]:
    """Return column and row of the corners of an image, (n, 2), by rows and then columns.

    A pixel is a corner if the grey changes along every line through it. The four direct neighbours are
    examined, and lines between them are interpolated; of corners that touch only the strongest is kept.

    Parameters
    ----------
    image : (rows, columns) uint8
        The image.
    first_threshold, second_threshold : float
        Squares of grey from which a pixel is a candidate by its two axes, and a corner by all lines.

    Raises
    ------
    ValueError
        If the image has no rows and columns of one grey each, or a threshold is negative.
    """
    _check(image)
    if first_threshold < 0.0 or second_threshold < 0.0:
        raise ValueError(f"thresholds are {first_threshold} and {second_threshold}; want zero or more")
    if min(image.shape) < 3:
        return np.zeros((0, 2), np.int64)
    grey = image.astype(np.float64)
    here = grey[1:-1, 1:-1]
    east, west, north, south = grey[1:-1, 2:], grey[1:-1, :-2], grey[2:, 1:-1], grey[:-2, 1:-1]
    by_row, by_column = ((one - here) ** 2 + (other - here) ** 2 for one, other in ((east, west), (north, south)))
    response = np.minimum(by_row, by_column)
    is_candidate = response > first_threshold
    # The least change along the lines between two neighbouring axes, where that lies between them.
    slopes = [(a - east) * (east - here) + (b - west) * (west - here) for a, b in ((north, south), (south, north))]
    slope = np.minimum(*slopes)
    curvature = by_column - by_row - 2.0 * slope
    is_between = (slope < 0.0) & (curvature + slope > 0.0)
    least = np.where(is_between, by_row - slope**2 / np.where(is_between, curvature, 1.0), response)
    strength = np.zeros(image.shape, np.float32)
    strength[1:-1, 1:-1] = np.where(is_candidate & (least > second_threshold), least, 0.0)
    strongest = cv2.dilate(strength, np.ones((3, 3), np.uint8))
    rows, columns = np.nonzero((strength > 0.0) & (strength >= strongest))
    return np.stack([columns, rows], axis=1).astype(np.int64)


def _check(image: NDArray[np.uint8]) -> None:
    if image.ndim != 2 or image.size == 0 or image.dtype != np.uint8:
        raise ValueError(
            f"an image has shape {image.shape} and type {image.dtype}; want rows and columns of uint8 greys"
        )
