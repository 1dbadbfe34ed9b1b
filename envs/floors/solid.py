"""What stands on a floor: vertical prisms, also thin ones."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.drawing import ring_edges


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A vertical prism.

    Attributes
    ----------
    polygon : (N, 2) float64
        Corners x, y in metres, at least three, in order, without repetition of the first.
    z_low, z_high : float
        Height range [m]; ``math.inf`` for a wall that reaches the ceiling.
    holes : tuple of (M, 2) float64
        Rings inside the polygon that are not solid [m].
    """

    polygon: NDArray[np.float64]
    z_low: float = 0.0
    z_high: float = math.inf
    holes: tuple[NDArray[np.float64], ...] = ()

    def __post_init__(self) -> None:
        if not self.z_low < self.z_high:
            raise ValueError(
                f"solid from z_low={self.z_low} to z_high={self.z_high} m has no height; want z_low < z_high"
            )
        object.__setattr__(self, "polygon", _ring("polygon", self.polygon))
        object.__setattr__(self, "holes", tuple(_ring("hole", hole) for hole in self.holes))

    @property
    def edges(self) -> NDArray[np.float64]:
        """Edges x1, y1, x2, y2 of the polygon and its holes, (E, 4) float64 [m]."""
        return np.concatenate([ring_edges(ring) for ring in (self.polygon, *self.holes)])

    def cuts(self, z_low: float, z_high: float) -> bool:
        """Return whether the solid cuts a height range [m].

        It is a plane where ``z_low == z_high``.
        """
        if z_low == z_high:
            return self.z_low <= z_low < self.z_high
        return self.z_low < z_high and self.z_high > z_low


def _following(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return of each corner the next one; `np.roll` takes five times as long for so few."""
    return np.concatenate([values[1:], values[:1]])


def _area(polygon: NDArray[np.float64]) -> float:
    x, y = (polygon - polygon[0]).T
    return abs(float(np.dot(x, _following(y)) - np.dot(y, _following(x)))) / 2.0


def width_of(polygon: NDArray[np.float64]) -> float:
    """Return the width of a polygon.

    It is that of its smallest rectangle or, for a bent strip, of the strip.
    """
    edges = _following(polygon) - polygon
    perimeter = float(np.hypot(*edges.T).sum())
    rectangle = min(cv2.minAreaRect((polygon - polygon[0]).astype(np.float32))[1])
    turns = edges[:, 0] * _following(edges[:, 1]) - edges[:, 1] * _following(edges[:, 0])
    convex = bool((turns >= -1e-12).all() or (turns <= 1e-12).all())
    return rectangle if convex or perimeter == 0.0 else min(rectangle, 2.0 * _area(polygon) / perimeter)


def middle_line(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the segments that stand for a thin polygon.

    They are the middle line of four corners, else the outline.
    """
    if len(polygon) != 4:
        return ring_edges(polygon)
    middles = (polygon + _following(polygon)) / 2.0
    lengths = np.hypot(*(_following(polygon) - polygon).T)
    k = 0 if lengths[0] + lengths[2] <= lengths[1] + lengths[3] else 1
    return np.concatenate([middles[k], middles[k + 2]])[None]


def _ring(kind: str, ring: NDArray[np.float64]) -> NDArray[np.float64]:
    corners = np.ascontiguousarray(ring, dtype=np.float64)
    if corners.ndim != 2 or corners.shape[0] < 3 or corners.shape[1] != 2 or not np.isfinite(corners).all():
        raise ValueError(
            f"{kind} has shape {corners.shape} or values that are not finite; want at least 3 points (x, y) "
            "in metres"
        )
    return corners
