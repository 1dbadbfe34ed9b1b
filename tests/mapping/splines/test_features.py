"""Curves, lines, corners and peaks of scans."""

import numpy as np
import pytest
from polygon_scans import ring, scan
from scanned_walls import LASER, points_of

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.splines.features import curves_of, observe
from lidarium.mapping.splines.scan_points import scan_points


def test_a_room_gives_curves_lines_and_corners_but_no_peaks():
    room = ring((-2, -1.5), (2.5, -1.5), (2.5, 1.5), (-2, 1.5))
    observation = observe(scan_points(scan(room, (0, 0, 0), LASER), LASER))
    assert len(curves_of(observation)) == 3
    assert len(observation.features.lines) == 3
    np.testing.assert_allclose(observation.features.corners, [(2.5, -1.5), (2.5, 1.5)], atol=0.01)
    assert len(observation.features.peaks) == 0


def test_the_edge_of_a_nearer_wall_is_a_peak_and_what_it_hides_is_not():
    walls = [(1.0, -1.0, 1.0, 0.3), (3.0, -9.0, 3.0, 9.0)]
    features = observe(points_of(walls)).features
    assert len(features.peaks) == 2
    np.testing.assert_allclose(features.peaks[1], (1.0, 0.3), atol=0.02)


def test_the_end_of_the_lasers_reach_is_no_peak():
    far = [(5.3, -3.0, 5.3, 3.0)]
    assert len(observe(points_of(far)).features.peaks) == 0


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.01])
def test_a_scan_that_shows_nothing_has_nothing_in_it(value):
    observation = observe(scan_points(np.full(LASER.beams, value, np.float32), LASER))
    assert observation.pieces == ()
    assert len(observation.features) == 0
    assert curves_of(observation) == []


def test_a_laser_of_one_beam_sees_no_curve():
    laser = ScanGeometry(beams=1)
    assert observe(scan_points(np.array([1.0], np.float32), laser)).pieces == ()
