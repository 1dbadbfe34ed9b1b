"""Length, nearest points and crossings of a curve."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.splines.curves.bspline import Spline


@st.composite
def splines(draw, least=4, most=12):
    count = draw(st.integers(least, most))
    gaps = draw(st.lists(st.floats(0.05, 2.0), min_size=count - 3, max_size=count - 3))
    ends = np.concatenate([[0.0], np.cumsum(gaps)])
    knots = np.concatenate([np.zeros(3), ends, np.full(3, ends[-1])])
    coordinates = st.floats(-5.0, 5.0)
    points = draw(st.lists(st.tuples(coordinates, coordinates), min_size=count, max_size=count))
    return Spline(knots, np.array(points))


def within(spline, shares):
    first, last = spline.domain
    return np.clip(first + np.asarray(shares) * (last - first), first, last)


def straight(length=2.0, count=5):
    inner = np.linspace(0.0, length, count - 2)
    knots = np.concatenate([np.zeros(3), inner, np.full(3, length)])
    points = (knots[1 : count + 1] + knots[2 : count + 2] + knots[3 : count + 3]) / 3.0
    return Spline(knots, np.stack([points, np.zeros(count)], axis=1))


@given(splines(most=8), st.tuples(st.floats(-6.0, 6.0), st.floats(-6.0, 6.0)))
def test_no_sample_is_nearer_than_the_closest_point(spline, point):
    parameters, distances = spline.closest([point])
    samples = spline.evaluate(np.linspace(*spline.domain, 2000))
    assert distances[0] <= np.linalg.norm(samples - point, axis=1).min() + 1e-3
    assert np.linalg.norm(spline.evaluate(parameters)[0] - point) == pytest.approx(distances[0], abs=1e-9)


@pytest.mark.parametrize("share", np.linspace(0.0, 1.0, 41))
def test_points_beside_a_cusp_are_found(share):
    # The last three control points are one: the curve comes to rest there, and Newton's steps beside it lead
    # too far.
    points = np.array([(3, -2), (0, -2), (5, -2), (0, 0), (0, 0), (0, 0.0)])
    spline = Spline(np.array([0, 0, 0, 0, 1, 1.25, 2.25, 2.25, 2.25, 2.25]), points)
    place = spline.evaluate(within(spline, [share]))
    assert spline.closest(place)[1][0] < 1e-6


def test_length_and_curvature_of_an_arc():
    quarter = Spline(
        np.array([0, 0, 0, 0, 1, 1, 1, 1.0]),
        np.array([(1, 0), (1, 4 / 3 * math.tan(math.pi / 8)), (4 / 3 * math.tan(math.pi / 8), 1), (0, 1)]),
    )
    assert quarter.length() == pytest.approx(math.pi / 2.0, abs=1e-3)
    np.testing.assert_allclose(quarter.curvature(np.linspace(0.05, 0.95, 9)), 1.0, atol=0.02)


@given(splines(most=8), st.floats(-math.pi, math.pi))
def test_a_ray_meets_the_curve_where_it_first_crosses_it(spline, direction):
    origin = np.array([0.3, -7.0])
    distance = spline.ray(origin, direction)
    samples = spline.evaluate(np.linspace(*spline.domain, 4000)) - origin
    aside = math.cos(direction) * samples[:, 1] - math.sin(direction) * samples[:, 0]
    ahead = math.cos(direction) * samples[:, 0] + math.sin(direction) * samples[:, 1]
    if math.isfinite(distance):
        met = origin + distance * np.array([math.cos(direction), math.sin(direction)])
        assert spline.closest([met])[1][0] < 1e-6
    else:
        crossings = (aside[:-1] * aside[1:] < 0.0) & (ahead[:-1] > 0.0) & (ahead[1:] > 0.0)
        # What a span crosses and crosses back between two samples may be passed over.
        assert crossings.sum() % 2 == 0


def test_a_ray_away_from_the_curve_meets_nothing():
    assert straight().ray([1.0, 1.0], -math.pi / 2.0) == pytest.approx(1.0)
    assert straight().ray([1.0, 1.0], math.pi / 2.0) == math.inf
    assert straight().ray([3.0, 1.0], -math.pi / 2.0) == math.inf
