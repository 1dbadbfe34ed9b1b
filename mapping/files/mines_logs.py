"""Logs of the rover of Mines ParisTech: text, one scan of a Hokuyo URG-04LX per line, plain or gzipped.

A line has numbers: the time [us], a number that is not needed, the counts of the left and the right wheel, 20
numbers that are not needed, 682 ranges [mm], of which those below 20 are codes of errors, and a last one.

References
----------
Steux, El Hamzaoui, tinySLAM: a SLAM algorithm in less than 200 lines (ICARCV 2010); the rover's numbers are those of
BreezySLAM (examples/mines.py, breezyslam/sensors.py).
"""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files.beams import marked, symmetric_scans
from lidarium.mapping.files.guarded_reading import read_lines, reading
from lidarium.mapping.files.laser_logs import LaserLog, made_usable
from lidarium.mapping.files.trajectories import interpolated
from lidarium.mapping.geometry.rigid import composed

_MAX_LINE_BYTES = 1 << 16

_WORDS, _BEFORE_RANGES, _BEAMS, _FIELD_OF_VIEW = 707, 24, 682, math.radians(240.0)
_LEAST_M, _MOST_M = 0.02, 5.6

_WHEEL_M, _HALF_AXLE_M, _COUNTS = 0.077, 0.165, 2000
"""Radius of the wheels, half the distance between them [m], and counts of a turn of a wheel."""

_LASER_AHEAD_M = 0.145

_DELAY_S = 0.15
"""A line has the counts of now and a scan of so long ago: turns of the scans of exp1.dat agree best with odometry then
(correlation 0.95, without the delay 0.69)."""


def read_mines_log(path: Path) -> LaserLog:
    """Read a log; lines that are damaged are left out and counted."""
    path = Path(path)
    rows, damaged = [], 0
    with reading(path, "a log of Mines ParisTech"):
        for line in read_lines(path, _MAX_LINE_BYTES):
            words = line.split()
            try:
                rows.append(np.array(words, np.float64) if len(words) == _WORDS else None)
            except ValueError:
                rows.append(None)
            damaged += rows[-1] is None and bool(words)
        kept = [row for row in rows if row is not None and np.isfinite(row).all()]
        if not kept:
            raise ValueError(f"{path} holds no scans; want lines of {_WORDS} numbers")
        return made_usable(_log(np.array(kept), damaged), str(path))


def _log(table: NDArray[np.float64], damaged: int) -> LaserLog:
    ranges = marked((1e-3 * table[:, _BEFORE_RANGES : _BEFORE_RANGES + _BEAMS]).astype(np.float32), _LEAST_M, _MOST_M)
    increment = _FIELD_OF_VIEW / (_BEAMS - 1)
    wide, geometry, axis, *_ = symmetric_scans(ranges, -0.5 * _FIELD_OF_VIEW, increment, (_LEAST_M, _MOST_M))
    stamps = 1e-6 * table[:, 0]
    return LaserLog(
        stamps,
        wide,
        geometry,
        interpolated(stamps, _driven(table[:, 2:4]), stamps - _DELAY_S),
        np.array([_LASER_AHEAD_M, 0.0, axis]),
        skipped={"damaged lines": damaged} if damaged else {},
    )


def _driven(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the poses (n, 3) by the counts (n, 2) of the left and the right wheel [m, rad]."""
    left, right = np.diff(counts, axis=0).T * (2.0 * math.pi * _WHEEL_M / _COUNTS)
    distance, turn = 0.5 * (left + right), 0.5 * (right - left) / _HALF_AXLE_M
    # Each motion is an arc, along its heading of half time to second order.
    poses = np.zeros((len(counts), 3))
    for k, (ahead, turned) in enumerate(zip(distance, turn, strict=True)):
        motion = [ahead * math.cos(0.5 * turned), ahead * math.sin(0.5 * turned), turned]
        poses[k + 1] = composed(poses[k], np.array(motion))
    return poses
