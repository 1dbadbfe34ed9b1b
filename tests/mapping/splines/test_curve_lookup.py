"""The nearest piece of a curve is looked up."""

import math

import numpy as np
import pytest
from curved_room import taken

from lidarium.mapping.splines.curve_lookup import CurveLookup


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
