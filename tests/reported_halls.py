"""Reports of robots made by hand, for the tests of the supervisor: cells of 0.05 m."""

import math

import numpy as np

from lidarium.envs.onboard.radio.messages import DriveState, OperatingState, Target
from lidarium.envs.onboard.station.reports import Report
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.incremental import GrowingMap

RESOLUTION, RADIUS = 0.05, 0.18


def hall(width=8.0, height=4.0, openings=()):
    """A hall with walls all around, its corner at (0, 0); openings (x, y) are 1 m of wall missing, with
    unknown behind."""
    columns, rows = round(width / RESOLUTION), round(height / RESOLUTION)
    levels = np.full((rows, columns), 255, np.uint8)
    levels[[0, -1]] = 0
    levels[:, [0, -1]] = 0
    for x, y in openings:
        row, column = round(y / RESOLUTION), round(x / RESOLUTION)
        part = levels[max(row - 10, 0) : row + 10, max(column - 10, 0) : column + 10]
        part[part == 0] = 255
    return GrowingMap(levels)


def report(levels, x, y, target=None, **changes):
    """A report of a robot at (x, y) on a map in the common frame of all, which it knows."""
    place = None if target is None else Target(*target)
    values = {
        "time_s": 10.0,
        "map": levels,
        "pose": Transform(x, y),
        "state": OperatingState.OPERATING,
        "drive": DriveState.IDLE if target is None else DriveState.DRIVING,
        "target": place,
        "path_left_m": 0.0 if target is None else math.dist((x, y), target),
        "travelled_m": 2.0,
        "energy_left_j": None,
        "start": Transform(1.0, 2.0),
        "frame": Transform(),
    }
    return Report(**{**values, **changes})
