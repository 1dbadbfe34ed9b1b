"""Curves of the map, and what is derived from them once."""

import math

import numpy as np
import pytest
from curved_room import taken

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.splines.association import Way
from lidarium.mapping.splines.curve import CurveLookup, _control_parameters, box_of, curves_in, fit_curve, make_curve
from lidarium.mapping.splines.settings import FitSettings, MapSettings


def fitted(points):
    points = np.asarray(points, float)
    return fit_curve(Way(points, np.ones(len(points))), 3, 7, FitSettings(), MapSettings())


def wall(angle=0.4, length=2.0):
    along = np.array([math.cos(angle), math.sin(angle)])
    return np.array([1.0, -1.0]) + np.linspace(0.0, length, 60)[:, None] * along


def arc(turn=2.0, radius=1.0):
    angles = np.linspace(0.0, turn, 80)
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def test_a_straight_wall_is_a_line_and_a_bent_one_is_not():
    curve = fitted(wall())
    middle = np.array([1.0 + math.cos(0.4), -1.0 + math.sin(0.4)])
    np.testing.assert_allclose(curve.line, (*middle, 0.4, 1.0), atol=0.01)
    assert fitted(arc()).line is None
    # A short wall has no clear direction.
    assert fitted(wall(length=0.3)).line is None
    assert (curve.count, curve.last_seen) == (3, 7)


def test_boxes_hold_the_curve_and_find_it():
    curves = [fitted(wall()), fitted(arc() + 10.0)]
    for curve in curves:
        low, high = curve.way.points.min(axis=0), curve.way.points.max(axis=0)
        assert curve.box == pytest.approx((*low, *high))
    assert curves_in(curves, (0.0, -2.0, 5.0, 5.0)) == [0]
    assert curves_in(curves, (-50.0, -50.0, 50.0, 50.0)) == [0, 1]
    assert curves_in(curves, (5.0, 5.0, 6.0, 6.0)) == []
    assert box_of(np.array([[1.0, 5.0], [-2.0, 7.0]])) == (-2.0, 5.0, 1.0, 7.0)


def test_a_curve_moves_with_its_frame():
    pose = Transform(2.0, 1.0, 0.7)
    curve, moved = fitted(wall()), fitted(wall()).moved(pose)
    np.testing.assert_allclose(moved.way.points, pose.apply(curve.way.points))
    np.testing.assert_allclose(moved.spline.control_points, pose.apply(curve.spline.control_points))
    np.testing.assert_allclose(moved.line[:2], pose.apply(curve.line[:2]))
    assert moved.line[2] == pytest.approx(curve.line[2] + 0.7)


def test_control_points_act_at_the_means_of_their_inner_knots():
    knots = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 3.0, 3.0, 3.0, 3.0])
    np.testing.assert_allclose(_control_parameters(knots), (0.0, 1.0 / 3.0, 4.0 / 3.0, 7.0 / 3.0, 3.0))


def test_a_curve_wants_a_weight_for_each_control_point():
    spline = fitted(wall()).spline
    with pytest.raises(ValueError, match=r"weights have shape \(2,\); the curve has 4 control points"):
        make_curve(spline, np.ones(2), 1, 1, 0.1)


def test_ends_of_little_weight_do_not_run_away():
    points = arc()
    weights = np.ones(len(points))
    weights[-10:] = 1e-3
    curve = fit_curve(Way(points, weights), 1, 1, FitSettings(), MapSettings())
    assert math.dist(curve.way.points[-1], points[-1]) < 0.02


@pytest.fixture(scope="module")
def room_map():
    return taken()


def test_the_lookup_finds_the_nearest_curve_and_how_far_it_is(room_map):
    lookup = CurveLookup(reach=5.6, distance=0.3)
    lookup.renew(room_map.curves, np.zeros(2))
    points = np.array([(2.9, 0.0), (0.0, -1.45), (0.0, 0.0)])
    pieces, distances = lookup.look_up(points)
    assert (pieces >= 0).tolist() == [True, True, False]
    expected = [min(curve.spline.closest([point])[1][0] for curve in room_map.curves) for point in points[:2]]
    np.testing.assert_allclose(distances[:2], expected, atol=0.002)
    assert distances[2] == math.inf
    assert lookup.covers(np.array([0.9, 0.0]))
    assert not lookup.covers(np.array([1.1, 0.0]))
