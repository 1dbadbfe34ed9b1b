"""Samples of scans lie where beams end, as many as are wanted."""

import numpy as np
import pytest

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.slam.scan_sampling import ScanSampling


def test_samples_lie_where_beams_end():
    laser, settings = ScanGeometry(), SlamSettings()
    angles = laser.angle_first + laser.angle_increment * np.arange(laser.beams)
    half = 2.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    ranges = half.astype(np.float32)
    points = ScanSampling(settings, laser).all_points(ranges)
    assert np.abs(points).max(axis=1) == pytest.approx(2.0, abs=1e-3)
    few = ScanSampling(settings, laser).points(ranges, 0.5, 10)
    assert 0 < len(few) <= 10
