"""Points of scans of a few walls, for tests of curves."""

import numpy as np
from polygon_scans import scan

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.splines.features import scan_points

LASER = ScanGeometry()


def points_of(walls, pose=(0.0, 0.0, 0.0), noise=0.0):
    return scan_points(scan(np.array(walls, np.float64), pose, LASER, noise), LASER)
