"""Codes that are no longer there: an image shows what lies behind them.

What has moved leaves its boxes behind, as other robots do. A box is gone where every pixel that should show
it shows something clearly farther away.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.point_clouds.intrinsics import Intrinsics
from lidarium.mapping.sparse.rigid_motions import inverse_of, moved_points

BEHIND_M = 0.15
"""What is farther behind a place than this is seen through it [m]."""

LEAST_DEPTH_M = 0.05
"""Nearer points are not projected [m]."""

AROUND_M = 0.02
"""Around a box, too, everything has to be farther away [m]."""

LEAST_PIXELS, COARSEST_M = 2.0, 0.03
"""Smaller boxes may lie between the pixels of an image, where these are farther apart [pixels, m]."""

_SHARES = np.array(list(itertools.product((0.0, 0.5, 1.0), repeat=3)))


def are_seen_through(
    boxes: NDArray[np.float64],
    depth: NDArray[np.float32],
    intrinsics: Intrinsics,
    pose: NDArray[np.float64],
    range_m: float,
) -> NDArray[np.bool_]:
    """Return which boxes an image shows to be gone.

    Parameters
    ----------
    boxes : (M, 2, 3) float64
        Low and high corners [m].
    depth : (rows, columns) float32
        The image [m]; 0 is no measurement, and shows nothing.
    intrinsics : Intrinsics
        Of its camera.
    pose : (4, 4) float64
        Pose of the camera's optical frame among the boxes.
    range_m : float
        Boxes farther away are left out [m].

    Returns
    -------
    (M,) bool
        Boxes that are wholly in the image, not lost in it, and seen through all over and around.
    """
    gone = np.zeros(len(boxes), np.bool_)
    into = inverse_of(pose)
    middles = _projected(moved_points(boxes.mean(axis=1), into), intrinsics)
    ahead = np.flatnonzero(_are_within(middles, depth.shape, range_m))
    if len(ahead) == 0:
        return gone
    low, high = boxes[ahead, None, 0] - AROUND_M, boxes[ahead, None, 1] + AROUND_M
    samples = moved_points((low + _SHARES * (high - low)).reshape(-1, 3), into)
    shown = _projected(samples, intrinsics).reshape(len(ahead), -1, 3)
    is_large = np.all(np.ptp(shown[..., :2], axis=1) >= LEAST_PIXELS, axis=1)
    is_fine = shown[..., 2].max(axis=1) <= COARSEST_M * intrinsics.fx
    is_chosen = (is_large | is_fine) & np.all(_are_within(shown, depth.shape, range_m), axis=1)
    ahead, shown = ahead[is_chosen], shown[is_chosen]
    columns, rows = np.rint(shown[..., 0]).astype(np.int64), np.rint(shown[..., 1]).astype(np.int64)
    gone[ahead] = np.all(depth[rows, columns] > shown[..., 2] + BEHIND_M, axis=1)
    return gone


def _projected(points: NDArray[np.float64], intrinsics: Intrinsics) -> NDArray[np.float64]:
    """Return column and row [pixels] and depth [m] of points (N, 3) in the optical frame, (N, 3)."""
    along = np.where(points[:, 2] > LEAST_DEPTH_M, points[:, 2], np.nan)
    columns = intrinsics.fx * points[:, 0] / along + intrinsics.cx
    rows = intrinsics.fy * points[:, 1] / along + intrinsics.cy
    return np.stack([columns, rows, along], axis=1)


def _are_within(shown: NDArray[np.float64], shape: tuple[int, ...], range_m: float) -> NDArray[np.bool_]:
    """Return which projected points (..., 3) lie in the image and are near enough, (...) bool."""
    limits = np.array([shape[1] - 1.0, shape[0] - 1.0, range_m])
    return np.asarray(np.all((shown >= 0.0) & (shown <= limits), axis=-1))
