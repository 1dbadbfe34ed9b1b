"""Recordings of a laser, for tests."""

import math

import numpy as np

from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.grids.scan_geometry import ScanGeometry


def recording():
    ranges = np.array([[1.0, math.inf, math.nan, 2.0], [1.5, 2.5, 3.5, math.inf]], np.float32)
    geometry = ScanGeometry(beams=4, field_of_view=2.0, range_min=0.1, range_max=5.0)
    readings = np.array([[0, 0, 0], [0.5, 0, 0], [1, 0, 0.1]], float)
    return LaserLog(
        stamps=np.array([0.0, 1.0]),
        ranges=ranges,
        geometry=geometry,
        odometry=readings[[0, 2]],
        laser_pose=np.array([0.1, 0.0, 0.5]),
        beam_interval_s=1e-4,
        corrected=np.ones((2, 3)),
        readings_stamps=np.array([0.0, 0.5, 1.0]),
        readings=readings,
        reading_of_scan=np.array([0, 2]),
    )
