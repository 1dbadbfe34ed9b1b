"""The log that is written to bags, and read from them."""

import math

import numpy as np
import pytest

from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.grids.scan_geometry import ScanGeometry

GEOMETRY = ScanGeometry(beams=9, field_of_view=math.pi, range_min=0.1, range_max=5.0)


@pytest.fixture
def log():
    """Scans, the laser before the robot's middle, odometry that turns past pi."""
    draws = np.random.default_rng(1)
    ranges = draws.uniform(0.2, 4.9, (20, 9)).astype(np.float32)
    ranges[3, 2], ranges[4, 5] = np.inf, np.nan
    turns = np.linspace(0.0, 8.0, 20)
    poses = np.stack([0.1 * turns, -0.2 * turns, turns], axis=1)
    return LaserLog(0.25 * np.arange(20) + 3.0, ranges, GEOMETRY, poses, np.array([0.1, 0.02, 0.3]))
