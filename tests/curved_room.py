"""A room taken into a map of curves, for tests of such maps."""

import math

import numpy as np
from polygon_scans import ring, scan

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.splines.features import observe, scan_points
from lidarium.mapping.splines.spline_map import SplineMap

LASER = ScanGeometry()


ROOM = np.vstack([ring((-2, -1.5), (3, -1.5), (3, 2), (-2, 2)), ring((0.5, 0.5), (1.1, 0.5), (1.1, 1.0), (0.5, 1.0))])


ROUND = [(0.3 * k, -0.8 + 0.1 * math.sin(0.7 * k), 0.6 * k) for k in range(8)]


def taken(walls=ROOM, poses=ROUND, noise=0.01, settings=None):
    spline_map = SplineMap(settings)
    for k, pose in enumerate(poses):
        points = scan_points(scan(walls, pose, LASER, noise, seed=k), LASER)
        spline_map.update(observe(points, settings), Transform(*pose))
    return spline_map
