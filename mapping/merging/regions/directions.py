"""Directions of walls: of single regions, and of whole maps, which say how one may be turned on another.

References
----------
Rotations by correlated directions of walls: Carpin, "Fast and accurate map merging for multi-robot systems",
Autonomous Robots 25, 2008.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.occupancy import OCCUPIED
from lidarium.mapping.merging.regions.meetings import NONE

QUARTER = math.pi / 2.0
BINS = 90
"""Bins of a histogram of directions, over a quarter turn."""

LEAST_CONTRAST = 1.3
"""The likeliest rotation is so many times as likely as the mean, where walls have directions at all."""

LIKELY = 0.4
"""Rotations are tried that are likelier than the mean by this share of what the likeliest one is."""

_SMOOTH_CELLS, _SMOOTH_BINS = 2.0, 2.0
"""Standard deviations with which free space and histograms are smoothed [cells, bins]."""


class Slopes(NamedTuple):
    """Slopes of free space at the cells beside walls: directions (n,) [rad] and regions (n,) int32."""

    directions: NDArray[np.float64]
    regions: NDArray[np.int32]


def wall_slopes(levels: NDArray[np.uint8], free: NDArray[np.uint8], labels: NDArray[np.int32]) -> Slopes:
    """Return across which directions walls run, at each cell of a region beside one.

    Parameters
    ----------
    levels, free, labels : (rows, columns) uint8, uint8, int32
        The three-level map, 1 where it is free, and its regions.
    """
    smooth = cv2.GaussianBlur(free.astype(np.float32), (0, 0), _SMOOTH_CELLS)
    is_wall = cv2.dilate((levels == OCCUPIED).astype(np.uint8), np.ones((3, 3), np.uint8))
    rows, columns = np.nonzero((is_wall > 0) & (labels != NONE))
    x, y = (cv2.Scharr(smooth, cv2.CV_32F, *order)[rows, columns] for order in ((1, 0), (0, 1)))
    return Slopes(np.arctan2(y, x).astype(np.float64), labels[rows, columns])


def region_axes(slopes: Slopes, count: int) -> NDArray[np.float64]:
    """Return the direction of each region's walls from 0 to a quarter turn, of all where it has none."""
    # Fourfold angles are alike for all four directions of a rectangle's walls.
    around = np.exp(4j * slopes.directions)
    sums = np.bincount(slopes.regions, around.real, count) + 1j * np.bincount(
        slopes.regions, around.imag, count
    )
    sums[sums == 0.0] = around.sum()
    return np.asarray((np.angle(sums) / 4.0) % QUARTER)


def direction_histogram(slopes: Slopes) -> NDArray[np.float64]:
    """Return how many walls run in each direction of a quarter turn, smoothed, shape (`BINS`,)."""
    bins = (slopes.directions % QUARTER / QUARTER * BINS).astype(np.int64) % BINS
    distance = np.minimum(np.arange(BINS), BINS - np.arange(BINS))
    smoothing = np.exp(-0.5 * (distance / _SMOOTH_BINS) ** 2)
    return _circular(np.bincount(bins, minlength=BINS).astype(np.float64), smoothing)


def likely_rotations(a: NDArray[np.float64], b: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the rotations of map b under which its walls run along those of map a.

    Parameters
    ----------
    a, b : (`BINS`,) float64
        Directions of the maps' walls.
    count : int
        Of rotations around the circle; all of them where walls run in all directions.

    Returns
    -------
    (n,) float64
        At most so many rotations, the likeliest among them [rad].
    """
    alike = _circular(a, np.roll(b[::-1], 1))
    mean, most = float(alike.mean()), float(alike.max())
    every = np.arange(count, dtype=np.float64) * (2.0 * math.pi / count)
    if most < LEAST_CONTRAST * mean or most == 0.0:
        return every
    rotations = every + float(alike.argmax()) / BINS * QUARTER
    values = alike[np.rint(rotations % QUARTER / QUARTER * BINS).astype(np.int64) % BINS]
    return np.asarray(rotations[values >= mean + LIKELY * (most - mean)])


def _circular(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the circular convolution of two arrays of one length."""
    return np.asarray(np.fft.irfft(np.fft.rfft(one) * np.fft.rfft(other), len(one)))
