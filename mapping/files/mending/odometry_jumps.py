"""Jumps of odometry that no robot makes, as where it is set to zero during a log."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import composed, relative

FASTEST_M_S, FASTEST_TURN = 3.0, 4.0
"""Speeds that an indoor robot reaches [m/s, rad/s]; what exceeds them may still be usual in a log."""

USUAL = 3.0
"""So many times the speed that 95 % of a log's motions keep below is still believed."""


def without_jumps(
    odometry: NDArray[np.float64], stamps: NDArray[np.float64]
) -> tuple[NDArray[np.float64], int]:
    """Return odometry without its jumps, and their number.

    Over a jump the robot is assumed to have moved as before it.

    Parameters
    ----------
    odometry : (n, 3) float64
        x, y, theta by dead reckoning [m, rad]; not finite where unknown.
    stamps : (n,) float64
        When, never decreasing [s].
    """
    if len(odometry) < 4 or not np.isfinite(odometry).all():
        return odometry, 0
    motions = relative(odometry[:-1], odometry[1:])
    steps = np.diff(stamps)
    # Stamps of scans that came in a bundle say nothing of the speed between them.
    steps = np.maximum(steps, np.median(steps))
    if not steps.all():
        return odometry, 0
    jumps = _beyond(np.hypot(motions[:, 0], motions[:, 1]) / steps, FASTEST_M_S) | _beyond(
        np.abs(motions[:, 2]) / steps, FASTEST_TURN
    )
    if not jumps.any():
        return odometry, 0
    mended = odometry.copy()
    for k, motion in enumerate(motions):
        if jumps[k]:
            motion = motions[k] = motions[k - 1] * (steps[k] / steps[k - 1]) if k else np.zeros(3)
        mended[k + 1] = composed(mended[k], motion)
    return mended, int(jumps.sum())


def _beyond(speeds: NDArray[np.float64], fastest: float) -> NDArray[np.bool_]:
    return np.asarray(speeds > max(fastest, USUAL * float(np.percentile(speeds, 95.0))))
