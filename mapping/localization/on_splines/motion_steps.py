"""Motions as a turn, a straight segment and a turn."""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import Transform, wrapped


def steps_of(motion: Transform) -> tuple[float, float, float]:
    """Split a motion into a turn, a straight segment and a turn [rad, m, rad].

    The segment leads ahead or back.
    """
    distance = math.hypot(motion.x, motion.y)
    if distance < 0.001:
        return 0.0, distance, motion.theta
    first = math.atan2(motion.y, motion.x)
    # A robot that backs up has not turned round twice.
    if abs(first) > math.pi / 2.0:
        first, distance = wrapped(first + math.pi), -distance
    return first, distance, wrapped(motion.theta - first)


def driven(poses: NDArray[np.float64], steps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses (n, 3) after a turn, a straight segment and a turn each, (n, 3) [rad, m, rad]."""
    headings = poses[:, 2] + steps[:, 0]
    return np.stack(
        [
            poses[:, 0] + steps[:, 1] * np.cos(headings),
            poses[:, 1] + steps[:, 1] * np.sin(headings),
            headings + steps[:, 2],
        ],
        axis=1,
    )
