import math

import numpy as np
import pytest
from polygon_scans import ring, scan

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.splines.breakpoints import clusters
from lidarium.mapping.splines.curves.settings import PointSettings, SegmentationSettings, SplineSettings
from lidarium.mapping.splines.features import curves_of, observe
from lidarium.mapping.splines.scan_points import scan_points
from lidarium.mapping.splines.segmentation import split_merge

LASER = ScanGeometry()
DIETMAYER, PEDRAZA = SegmentationSettings(test="dietmayer"), SegmentationSettings(test="pedraza")


def points_of(walls, pose=(0.0, 0.0, 0.0), noise=0.0):
    return scan_points(scan(np.array(walls, np.float64), pose, LASER, noise), LASER)


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


def test_an_l_is_two_lines_that_meet_at_its_corner():
    angle = [(1.5, -1.0, 1.5, 1.0), (1.5, 1.0, -0.5, 1.0)]
    points = points_of(angle, noise=0.005)
    (first, last), *others = clusters(points).tolist()
    cut = split_merge(points.points[first:last], points.sigmas[first:last])
    assert not others
    assert len(cut.pieces) == 2
    assert math.dist(cut.corners[0], (1.5, 1.0)) < 0.02
    turn = cut.lines[1, 2] - cut.lines[0, 2]
    assert math.degrees(abs(math.atan2(math.sin(turn), math.cos(turn)))) == pytest.approx(90.0, abs=1.0)


def test_slopes_find_the_corner_too_except_where_walls_mirror_each_other():
    points = points_of([(1.5, -1.0, 1.5, 1.0), (1.5, 1.0, -0.5, 1.2)])
    first, last = clusters(points)[0]
    by_slope = SegmentationSettings(corner_rule="slope")
    assert len(split_merge(points.points[first:last], points.sigmas[first:last], by_slope).pieces) == 2


@pytest.mark.parametrize("radius", [0.8, 1.0, 1.5])
def test_a_round_wall_is_one_piece(radius):
    angles = np.linspace(0.0, 2.5, 240)
    points = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points += 0.005 * np.random.default_rng(0).standard_normal(points.shape)
    assert len(split_merge(points, np.full(240, 0.005)).pieces) == 1


def test_leaves_cover_all_points_in_order():
    generator = np.random.default_rng(4)
    points = np.cumsum(generator.uniform(-0.1, 0.1, (150, 2)), axis=0)
    leaves = split_merge(points).leaves
    assert leaves[0, 0] == 0
    assert leaves[-1, 1] == 149
    assert (leaves[1:, 0] == leaves[:-1, 1]).all()
    assert (leaves[:, 1] > leaves[:, 0]).all()


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


@pytest.mark.parametrize(
    "make",
    [
        lambda: SegmentationSettings(test="none"),
        lambda: SegmentationSettings(least_points=3),
        lambda: SegmentationSettings(incidence=2.0),
        lambda: PointSettings(noise_floor=0.0),
        lambda: SegmentationSettings(corner_rule="bend"),
    ],
)
def test_settings_that_make_no_sense_are_refused(make):
    with pytest.raises(ValueError, match="want"):
        make()


def test_settings_are_whole_by_default():
    assert SplineSettings().segmentation == SegmentationSettings()
