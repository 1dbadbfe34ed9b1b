"""Correlation of two maps at all translations at once, for some rotations.

It is slow, but needs no corners.

Maps are reduced to coarse counts of walls and of free space away from walls. Walls on walls count for a
translation, walls in free space against it; the sums over all translations are correlations, products of
spectra.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import FromZero, Length, check_settings, within
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.occupancy import FREE
from lidarium.mapping.merging.described_map import DescribedMap


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelationSettings:
    """How finely all transforms are tried.

    Attributes
    ----------
    cell_m : float, default 0.15
        Side of a coarse cell [m]; larger for maps that would have more than ``most_cells`` along a side.
    most_cells : int, default 200
        Bound of time and memory [coarse cells].
    rotations : int, default 72
        Rotations around the circle that the fallback tries; 0 for no fallback.
    peaks : int, default 3
        Translations that are kept for each rotation.
    miss_weight : float, default 1.0
        How much a wall in free space counts against one that lies on a wall.
    free_weight : float, default 0.03
        How much a cell that is free in both maps counts: walls seen from two sides alone are no sign of one
        place.
    """

    cell_m: Length = 0.15
    most_cells: Annotated[int, within(16, 2048)] = 200
    rotations: Annotated[int, within(0, 3600)] = 72
    peaks: Annotated[int, within(1, 1000)] = 3
    miss_weight: FromZero = 1.0
    free_weight: FromZero = 0.03

    def __post_init__(self) -> None:
        check_settings(self, "correlation")


@dataclass(frozen=True, slots=True, eq=False)
class _Coarse:
    """A map in coarse cells: weighted wall points, and free space.

    Wall points are in coarse cells.
    """

    walls: NDArray[np.float64]
    weight: float
    free: NDArray[np.float32]


def best_translations(
    a: DescribedMap,
    b: DescribedMap,
    rotations: NDArray[np.floating],
    settings: CorrelationSettings,
    apart_m: float = 0.5,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Find the best translations for each rotation of map b.

    The walls of map b agree best with those of map a under them.

    Parameters
    ----------
    a, b : DescribedMap
        Maps of one resolution.
    rotations : (n,) float64
        Angles of b's axes in a [rad].
    settings : CorrelationSettings
        Coarseness.
    apart_m : float
        Translations of one rotation are at least so far apart [m].

    Returns
    -------
    transforms : (n * peaks, 3) float64
        x, y [m] and theta [rad] of ``a_from_b``.
    values : (n * peaks,) float64
        The walls that agree less those that do not [m].
    """
    if len(a.walls) == 0 or len(b.walls) == 0 or len(rotations) == 0:
        return np.zeros((0, 3)), np.zeros(0)
    longest = max(*a.levels.shape, *b.levels.shape)
    cell = a.resolution * max(settings.cell_m / a.resolution, 1.0, longest / settings.most_cells)
    first, second = _coarse(a, cell), _coarse(b, cell)
    reach = math.ceil(math.hypot(*second.free.shape)) + 2
    shape = tuple(scipy.fft.next_fast_len(side + reach, real=True) for side in first.free.shape)
    walls = _drawn(first.walls, first.weight, first.free.shape)
    near = cv2.GaussianBlur(walls, (3, 3), 0.8)
    clear = _clear(first.free, walls)
    met_by_walls = scipy.fft.rfft2(near - settings.miss_weight * clear, shape)
    met_by_free = scipy.fft.rfft2(settings.free_weight * clear - settings.miss_weight * walls, shape)
    transforms, values = [], []
    for theta in rotations.tolist():
        turned, free, corner = _turned(second, theta, reach)
        product = met_by_walls * np.conj(scipy.fft.rfft2(turned, shape))
        product += met_by_free * np.conj(scipy.fft.rfft2(_clear(free, turned), shape))
        total = np.asarray(scipy.fft.irfft2(product, shape, overwrite_x=True), np.float32)
        for row, column, value in _peaks(total, settings.peaks, math.ceil(apart_m / cell)):
            # A shift beyond what the first map spans is a negative one.
            down = row - shape[0] if row >= first.free.shape[0] else row
            left = column - shape[1] if column >= first.free.shape[1] else column
            transforms.append(((left + corner[0]) * cell, (down + corner[1]) * cell, theta))
            values.append(value * cell)
    return np.array(transforms), np.array(values)


def _coarse(described: DescribedMap, cell: float) -> _Coarse:
    rows, columns = described.levels.shape
    scale = described.resolution / cell
    shape = (max(math.ceil(rows * scale), 1), max(math.ceil(columns * scale), 1))
    mask = np.asarray((described.levels == FREE) * np.uint8(255), np.uint8)
    turn = np.array([[scale, 0.0, 0.5 * scale - 0.5], [0.0, scale, 0.5 * scale - 0.5]])
    smooth = max(round(1.0 / scale), 1)
    free = cv2.warpAffine(
        cv2.blur(mask, (smooth, smooth), borderType=cv2.BORDER_CONSTANT),
        turn,
        shape[::-1],
        flags=cv2.INTER_NEAREST,
    )
    # A wall of one cell's length weighs its share of a coarse cell.
    return _Coarse(described.walls / cell, scale, np.asarray(free, np.float32) / np.float32(255.0))


def _drawn(walls: NDArray[np.float64], weight: float, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return the walls counted in the cells of a grid.

    The count of a cell is limited to that of one wall running through it.
    """
    column = np.clip(walls[:, 0].astype(np.int64), 0, shape[1] - 1)
    row = np.clip(walls[:, 1].astype(np.int64), 0, shape[0] - 1)
    counts = np.bincount(row * shape[1] + column, minlength=shape[0] * shape[1]).reshape(shape[0], shape[1])
    return np.asarray(np.minimum(counts * weight, 1.0), np.float32)


def _clear(free: NDArray[np.float32], walls: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the free cells without a wall in the same cell or next to it."""
    beside = cv2.dilate(walls, np.ones((3, 3), np.uint8))
    return np.asarray(np.where((free > 0.9) & (beside == 0.0), 1.0, 0.0), np.float32)


def _turned(
    coarse: _Coarse, theta: float, side: int
) -> tuple[NDArray[np.float32], NDArray[np.float32], tuple[float, float]]:
    """Return walls and free space rotated into a grid, and the map's corner in it.

    The corner is the map's own, in cells.
    """
    rows, columns = coarse.free.shape
    cosine, sine = math.cos(theta), math.sin(theta)
    x = side / 2.0 - (cosine * columns / 2.0 - sine * rows / 2.0)
    y = side / 2.0 - (sine * columns / 2.0 + cosine * rows / 2.0)
    walls = Transform(x, y, theta).apply(coarse.walls)
    # The centre of pixel (0, 0) is at (0.5, 0.5) of the grid.
    shift_x, shift_y = x + 0.5 * (cosine - sine) - 0.5, y + 0.5 * (sine + cosine) - 0.5
    free = cv2.warpAffine(
        coarse.free,
        np.array([[cosine, -sine, shift_x], [sine, cosine, shift_y]]),
        (side, side),
        flags=cv2.INTER_LINEAR,
    )
    return _drawn(walls, coarse.weight, (side, side)), np.asarray(free, np.float32), (x, y)


def _peaks(total: NDArray[np.float32], count: int, apart: int) -> list[tuple[int, int, float]]:
    """Return row, column and value of the largest entries, apart from one another.

    The array is changed.
    """
    found = []
    rows, columns = total.shape
    for _ in range(count):
        row, column = divmod(int(total.argmax()), columns)
        found.append((row, column, float(total[row, column])))
        window = np.arange(-apart, apart + 1)
        total[np.ix_((row + window) % rows, (column + window) % columns)] = -np.inf
    return found
