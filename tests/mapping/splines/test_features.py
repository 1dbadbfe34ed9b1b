"""Curves, lines, corners and peaks of scans."""

import numpy as np
import pytest
from polygon_scans import ring, scan
from scanned_walls import LASER, points_of

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.splines.features import clusters, curves_of, observe, scan_points
from lidarium.mapping.splines.settings import PointSettings, SegmentationSettings


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


@pytest.mark.parametrize("test", ["adaptive", "dietmayer", "pedraza"])
def test_two_walls_with_a_gap_are_two_clusters(test):
    points = points_of([(2.0, -1.0, 2.0, -0.2), (2.0, 0.2, 2.0, 1.0)])
    assert len(clusters(points, SegmentationSettings(test=test))) == 2


@pytest.mark.parametrize("test", ["adaptive", "dietmayer", "pedraza"])
def test_a_wall_behind_another_is_a_cluster_of_its_own(test):
    points = points_of([(1.5, -1.0, 1.5, 0.0), (2.5, -0.5, 2.5, 1.0)])
    assert len(clusters(points, SegmentationSettings(test=test))) == 2


def test_a_slanted_wall_is_one_surface_to_the_adaptive_test_only():
    slanted = [(0.5, -0.4, 5.0, -0.9)]
    assert len(clusters(points_of(slanted))) == 1
    direct = SegmentationSettings(test="dietmayer", dietmayer_floor=0.01, dietmayer_share=0.005)
    first, last = clusters(points_of(slanted), direct)[0]
    assert last - first < len(points_of(slanted).points)


def test_invalid_beams_and_beams_without_a_return_break():
    ranges = np.full(LASER.beams, 2.0, np.float32)
    ranges[300], ranges[500] = np.nan, np.inf
    assert clusters(scan_points(ranges, LASER)).tolist() == [[0, 300], [300, 499], [499, 725]]


def test_small_clusters_are_left_out():
    ranges = np.full(LASER.beams, np.inf, np.float32)
    ranges[[10, 11, 12]] = 1.0
    ranges[100:104] = 1.0
    assert len(clusters(scan_points(ranges, LASER))) == 1


def test_each_beam_is_placed_where_it_was_seen_at_its_own_time():
    wall = np.array([(3.0, -4.0, 3.0, 4.0)])
    interval, speed, turn = 0.0001, 1.0, 0.8
    ranges = np.empty(LASER.beams, np.float32)
    duration = interval * (LASER.beams - 1)
    poses = [Transform(speed * interval * k, 0.0, turn * interval * k) for k in range(LASER.beams)]
    for k, pose in enumerate(poses):
        ranges[k] = scan(wall, (pose.x, pose.y, pose.theta), LASER)[k]
    still = scan_points(ranges, LASER)
    moving = scan_points(
        ranges, LASER, PointSettings(beam_interval_s=interval), poses[0].inverse() @ poses[-1], duration
    )
    placed, unplaced = (poses[-1].apply(points.points) for points in (moving, still))
    assert np.abs(placed[:, 0] - 3.0).max() < 0.002
    assert np.abs(unplaced[:, 0] - 3.0).max() > 0.05


def test_a_scan_of_another_laser_is_refused():
    with pytest.raises(ValueError, match="727 beams"):
        scan_points(np.ones(10, np.float32), LASER)
