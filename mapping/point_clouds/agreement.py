"""Whether frames with poses agree: what one sees through, another should not have seen there.

Of each frame the nearest range in each direction is kept. A point of another frame that is clearly nearer contradicts
it, one at about that range agrees, and one behind it says nothing. Wrong poses and scales show in the share of points
that contradict. A focal length that is wrong by a tenth bends walls by less than that tolerates: it shows in the mean
distance of what agrees, which is smaller if all points are stretched as the right one would place them.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid_motions import inverse_of

FRAMES = 12
"""Frames that others are compared with, at most: they spread over the sequence."""

POINTS = 3000
"""Points of a frame that are compared."""

MIN_POINTS = 500
"""If fewer points tell, the agreement is unknown."""

MIN_NEAR = 100
"""If fewer points lie near those of another frame, their mean difference is unknown."""

ROWS, COLUMNS = 90, 180
"""Directions in which a range is kept."""

NEAR_M, NEAR_SHARE = 0.05, 0.03
"""Ranges agree if they differ by less than the sum of this and this share of them [m]."""


FAR_M = 0.3
"""Maximum distance of points that count towards the mean [m]; those farther off belong to something else."""


@dataclass(frozen=True, eq=False, slots=True)
class _View:
    """Ranges of a frame: nearest and farthest (ROWS, COLUMNS) [m], inf and 0 if there are none, and its pose."""

    nearest: NDArray[np.float64]
    farthest: NDArray[np.float64]
    into: NDArray[np.float64]


class FrameAgreement:
    """Compares frames with poses, one after the other.

    Parameters
    ----------
    stretch : float, default 1.0
        Factor of x and y, across the optical axis, that is tried: one over that of the focal length.
    """

    def __init__(self, stretch: float = 1.0) -> None:
        self._stretch = np.array([stretch, stretch, 1.0])
        self._views: list[_View] = []
        self._step, self._count = 1, 0
        self.agreeing, self.contradicting = 0, 0
        self._distances, self._near = 0.0, 0

    def add(self, points: NDArray[np.floating], pose: NDArray[np.float64]) -> None:
        """Add a frame.

        Parameters
        ----------
        points : (N, 3) float
            Finite points in the sensor's frame [m].
        pose : (4, 4) float64
            Pose of that frame in the map.
        """
        step = max(len(points) // POINTS, 1)
        in_map = (np.asarray(points[::step], np.float64) * self._stretch) @ pose[:3, :3].T + pose[:3, 3]
        for view in self._views:
            self._compare(in_map, view)
        if self._count % self._step == 0:
            self._views.append(_view_of(np.asarray(points, np.float64) * self._stretch, pose))
            if len(self._views) > FRAMES:
                self._views, self._step = self._views[::2], 2 * self._step
        self._count += 1

    @property
    def share(self) -> float | None:
        """Share of the points that agree, of those that tell; None if these are too few."""
        told = self.agreeing + self.contradicting
        return None if told < MIN_POINTS else self.agreeing / told

    @property
    def mean_distance(self) -> float | None:
        """Mean difference of ranges of points that are about where another frame has its own [m]; None if few are."""
        return None if self._near < MIN_NEAR else self._distances / self._near

    def _compare(self, in_map: NDArray[np.float64], view: _View) -> None:
        places, ranges = _directions(in_map @ view.into[:3, :3].T + view.into[:3, 3])
        nearest, farthest = view.nearest.ravel()[places], view.farthest.ravel()[places]
        tolerance = NEAR_M + NEAR_SHARE * ranges
        is_before = ranges < nearest - tolerance
        self.contradicting += int(np.count_nonzero(is_before & np.isfinite(nearest)))
        self.agreeing += int(np.count_nonzero(~is_before & (ranges < farthest + tolerance)))
        # Directions in which a frame sees a surface, not a step from one to another.
        distances = np.abs(ranges - 0.5 * (nearest + farthest))[farthest - nearest < 2.0 * tolerance]
        distances = distances[distances < FAR_M]
        self._distances += float(distances.sum())
        self._near += len(distances)


def _directions(points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the place of the direction to points (N, 3), and their ranges [m]."""
    ranges = np.linalg.norm(points, axis=1)
    # No frame looks along both of the poles at once: the z axis of cameras points ahead.
    up = np.arcsin(np.clip(-points[:, 1] / np.maximum(ranges, 1e-9), -1.0, 1.0))
    around = np.arctan2(points[:, 0], points[:, 2])
    rows = np.clip(((up / np.pi + 0.5) * ROWS).astype(np.int64), 0, ROWS - 1)
    columns = np.clip(((around / (2.0 * np.pi) + 0.5) * COLUMNS).astype(np.int64), 0, COLUMNS - 1)
    return rows * COLUMNS + columns, ranges


def _view_of(points: NDArray[np.float64], pose: NDArray[np.float64]) -> _View:
    places, ranges = _directions(points)
    order = np.argsort(ranges)
    nearest, farthest = np.full(ROWS * COLUMNS, np.inf), np.zeros(ROWS * COLUMNS)
    nearest[places[order[::-1]]], farthest[places[order]] = ranges[order[::-1]], ranges[order]
    near_image, far_image = nearest.reshape(ROWS, COLUMNS), farthest.reshape(ROWS, COLUMNS)
    is_seen = np.isfinite(near_image)
    # Directions beside an edge, or beside none, do not tell.
    inner = scipy.ndimage.minimum_filter(is_seen, 3, mode="constant")
    low, high = scipy.ndimage.minimum_filter(near_image, 3), scipy.ndimage.maximum_filter(far_image, 3)
    return _View(np.where(inner, low, np.inf), np.where(inner, high, 0.0), inverse_of(pose))
