import copy
import math
import pickle

import numpy as np
import pytest
from curved_room import LASER, ROOM, ROUND, taken
from polygon_scans import distances_to, scan

from lidarium.mapping.files.spline_files import compact_bytes
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.splines.features import observe, scan_points
from lidarium.mapping.splines.settings import spline_settings
from lidarium.mapping.splines.spline_map import SplineMap


@pytest.fixture(scope="module")
def room_map():
    return taken()


def test_a_room_becomes_a_few_curves_on_its_walls(room_map):
    errors = distances_to(ROOM, room_map.sample())
    assert errors.mean() < 0.01
    assert np.quantile(errors, 0.95) < 0.03
    assert 4 <= len(room_map.curves) <= 12


def test_corners_of_the_room_are_found_where_they_are(room_map):
    known = room_map.corners.points[room_map.corners.counts >= 3]
    for corner in ((-2, -1.5), (3, -1.5), (3, 2), (-2, 2)):
        assert np.linalg.norm(known - corner, axis=1).min() < 0.03


def test_seeing_the_same_again_does_not_make_the_map_grow():
    once, often = taken(poses=ROUND), taken(poses=ROUND * 4)
    assert len(often.curves) <= len(once.curves) + 1
    assert compact_bytes(often) < 1.3 * compact_bytes(once)


def test_a_wall_seen_from_both_sides_is_two_curves():
    spline_map = taken(
        np.array([(1.0, -1.0, 1.0, 1.0), (1.05, -1.0, 1.05, 1.0)]), [(0, 0, 0), (2, 0, math.pi)], noise=0.0
    )
    assert len(spline_map.curves) == 2
    first, second = (curve.spline.tangents([0.5])[0] for curve in spline_map.curves)
    assert float(first @ second) < -0.99


def test_two_views_of_one_wall_grow_together_when_a_third_joins_them():
    wall = np.array([(-4.0, 1.5, 4.0, 1.5)])
    block = np.array([(-0.6, 0.8, 0.6, 0.8)])
    apart = taken(np.vstack([wall, block]), [(0, 0, math.pi / 2)], noise=0.0)
    assert len(apart.curves) == 3
    joined = SplineMap()
    for walls in (np.vstack([wall, block]), wall):
        joined.update(
            observe(scan_points(scan(walls, (0, 0, math.pi / 2), LASER), LASER)),
            Transform(0.0, 0.0, math.pi / 2),
        )
    assert len(joined.curves) == 2
    assert max(curve.spline.length() for curve in joined.curves) > 6.0


def test_the_map_predicts_ranges(room_map):
    assert room_map.ray(np.array([0.0, 0.0]), 0.0) == pytest.approx(3.0, abs=0.02)
    assert SplineMap().ray(np.array([0.0, 0.0]), 0.0) == math.inf


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.005])
def test_a_scan_that_shows_nothing_changes_nothing(value):
    spline_map = taken()
    before = spline_map.sample()
    spline_map.update(observe(scan_points(np.full(LASER.beams, value, np.float32), LASER)), Transform())
    np.testing.assert_array_equal(spline_map.sample(), before)


def test_the_rules_of_the_thesis_make_a_map_too():
    settings = spline_settings("thesis")
    errors = distances_to(ROOM, taken(settings=settings).sample())
    assert np.median(errors) < 0.02
    with pytest.raises(ValueError, match="mode of spline maps"):
        spline_settings("other")


def test_the_same_scans_make_the_same_map_to_the_bit(room_map):
    again = taken()
    np.testing.assert_array_equal(again.sample(), room_map.sample())
    for copied in (copy.deepcopy(again), pickle.loads(pickle.dumps(again))):
        np.testing.assert_array_equal(copied.sample(), room_map.sample())


def test_a_map_in_another_frame_joins_the_same_walls_once(room_map):
    frame = Transform(0.7, -0.4, 0.9)
    joined = SplineMap()
    joined.absorb(room_map, Transform())
    joined.absorb(room_map.around(frame, 20.0), frame)
    assert len(joined.curves) <= len(room_map.curves) + 1
    assert joined.length == pytest.approx(room_map.length, rel=0.05)
    assert distances_to(ROOM, joined.sample()).mean() < 0.01
    assert len(joined.corners) == len(room_map.corners)
    np.testing.assert_allclose(joined.corners.points, room_map.corners.points, atol=1e-9)


def test_a_map_around_a_place_holds_what_is_near_it(room_map):
    near = room_map.around(Transform(-2.0, -1.5, 0.3), 0.5)
    assert 0 < len(near.curves) < len(room_map.curves)
    assert np.abs(near.corners.points).max() <= 0.5
    assert len(near.corners) >= 1


def test_maps_of_both_ends_of_a_wall_become_one_wall():
    wall = np.array([(-8.0, 1.0, 8.0, 1.0)])
    left = taken(wall, [(-2.0 + 0.2 * k, 0.0, math.pi / 2.0) for k in range(4)])
    right = taken(wall, [(1.0 + 0.2 * k, 0.0, math.pi / 2.0) for k in range(4)])
    left.absorb(right, Transform())
    assert len(left.curves) == 1


def test_a_curve_counts_no_more_scans_than_there_were():
    """Pieces of a curve that was cut at a corner inherit its count, and are joined again."""
    spline_map = taken(poses=ROUND * 6)
    assert 3 <= max(curve.count for curve in spline_map.curves) <= spline_map.updates
