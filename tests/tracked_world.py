"""A run past an L of walls, for the tests of localizers on spline maps."""

import math

import numpy as np
from polygon_scans import ring, scan

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.localizer import Sensing

LASER = ScanGeometry()
WORLD_2 = np.vstack(
    [
        ring((-1.5, -1.5), (4.5, -1.5), (4.5, 4.5), (-1.5, 4.5)),
        ring((-0.7, 2.2), (2.0, 2.2), (2.0, -0.5), (2.3, -0.5), (2.3, 2.5), (-0.7, 2.5)),
    ]
)


def way_round(steps=90):
    """A way from the start of the world with an L past its right side."""
    corners = np.array([(0.0, 0.0), (1.6, -1.0), (2.8, -0.9), (3.3, 1.0), (3.0, 3.5)])
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    along = np.linspace(0.0, lengths[-1], steps)
    places = np.stack([np.interp(along, lengths, corners[:, k]) for k in (0, 1)], axis=1)
    headings = np.unwrap(np.arctan2(*np.gradient(places, axis=0).T[::-1]))
    kernel = np.ones(9) / 9.0
    smooth = np.convolve(np.pad(headings, 4, mode="edge"), kernel, mode="valid")
    return np.column_stack([places, smooth])


POSES = way_round()
SCANS = [scan(WORLD_2, pose, LASER, noise=0.01, seed=k) for k, pose in enumerate(POSES)]


def follow(localizer, odometry, seed=0, scans=SCANS):
    localizer.reset(POSES[0], seed)
    return np.array([localizer.localize(Sensing(0.1 * k, odometry[k], ranges)) for k, ranges in enumerate(scans)])


def gap(first, second):
    return float(np.hypot(*(first - second)[:2])), abs(math.remainder(float(first[2] - second[2]), math.tau))
