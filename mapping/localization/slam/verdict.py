"""Whether the map of a followed log is probably wrong, and why.

Bounds were chosen on logs of eight buildings whose maps are right (scans in doubt: 1.7 % at most; motion of scans
against that of odometry: 0.95 to 1.02 of the length, 0.95 to 1.00 of the turns), on logs that lie (odometry or ranges
stretched, fields of view and mountings that are not the laser's, scans out of step with odometry), and on logs with too
little in common from scan to scan.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import relative

_MAX_DOUBTFUL = 0.04
"""Share of scans in doubt beyond which a map is probably wrong."""

_STEP_M, _STEP_ANGLE = 0.3, 0.3
"""Motions of at least this size are compared, so that the noise of scans does not count [m, rad]."""

_MIN_STEPS = 20
"""Minimum number of motions that are compared."""

_RATIO, _LEVER = 0.15, 0.2
"""By how much lengths and turns by scans may differ from those by odometry, and paths from such lengths."""

_DIRECTION = math.radians(20.0)
"""By how much directions of motion by scans may differ from those by odometry [rad]."""


def reasons_to_doubt(
    poses: NDArray[np.float64], odometry: NDArray[np.float64] | None, doubtful: int, taken: int, restarts: int
) -> list[str]:
    """Return reasons for which the map is probably wrong; empty if there are none.

    Parameters
    ----------
    poses : (n, 3) float64
        Poses of the robot by SLAM [m, rad].
    odometry : (n, 3) float64 or None
        The same by odometry, nan if unknown; None if it was not used.
    doubtful, taken, restarts : int
        Scans in doubt, scans that were matched or failed to be, and how often the map was begun anew.
    """
    reasons = []
    if doubtful > max(_MAX_DOUBTFUL * taken, 2.0):
        reasons.append(f"{doubtful} of {taken} scans are doubtful")
    if restarts:
        reasons.append(f"the robot was lost {restarts} times, and the map begun anew")
    if odometry is not None:
        reasons += _contradictions(poses, odometry)
    return reasons


def _contradictions(poses: NDArray[np.float64], odometry: NDArray[np.float64]) -> list[str]:
    """Return in which ways the motions by scans contradict those by odometry as a whole."""
    ends = _steps(odometry)
    if len(ends) < _MIN_STEPS:
        return []
    measured, found = (
        relative(odometry[ends[:, 0]], odometry[ends[:, 1]]),
        relative(poses[ends[:, 0]], poses[ends[:, 1]]),
    )
    reasons = []
    turns = np.remainder(found[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    wanted = np.remainder(measured[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    turned = float(wanted @ wanted)
    if turned > _MIN_STEPS * 0.25 * _STEP_ANGLE**2 and abs(ratio := float(wanted @ turns) / turned - 1.0) > _RATIO:
        reasons.append(
            f"turns by scans are {1.0 + ratio:.2f} of those by odometry: the field of view, the clock or odometry is "
            "wrong"
        )
    before, after = measured[:, 0] + 1j * measured[:, 1], found[:, 0] + 1j * found[:, 1]
    moved = float(np.vdot(before, before).real)
    if moved < _MIN_STEPS * 0.25 * _STEP_M**2:
        return reasons
    motion = complex(np.vdot(before, after)) / moved
    if abs(math.atan2(motion.imag, motion.real)) > _DIRECTION and abs(motion) > 1.0 - 2.0 * _RATIO:
        degrees = math.degrees(math.atan2(motion.imag, motion.real))
        reasons.append(
            f"by scans the robot moves {degrees:.0f} degrees away from its direction by odometry: the laser is mounted "
            "otherwise"
        )
    elif abs(abs(motion) - 1.0) > _RATIO:
        reasons.append(
            f"lengths by scans are {abs(motion):.2f} of those by odometry: ranges or odometry have another scale"
        )
    elif float(np.abs(after).sum()) > (1.0 + _LEVER) * abs(motion) * float(np.abs(before).sum()):
        reasons.append("by scans the robot moves aside where it turns by odometry: the laser is mounted otherwise")
    return reasons


def _steps(odometry: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return numbers of scans (n, 2) from one to the other of which odometry moves far enough."""
    ends, start = [], 0
    for k, pose in enumerate(odometry):
        motion = relative(odometry[start], pose)
        if not np.isfinite(motion).all():
            start = k
        elif math.hypot(motion[0], motion[1]) > _STEP_M or abs(motion[2]) > _STEP_ANGLE:
            ends.append((start, k))
            start = k
    return np.array(ends, np.int64).reshape(-1, 2)
