import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from lidarium.mapping.splines.bspline import ORDER, Spline, _basis_matrix


def straight(length=2.0, count=5):
    inner = np.linspace(0.0, length, count - 2)
    knots = np.concatenate([np.zeros(3), inner, np.full(3, length)])
    points = (knots[1 : count + 1] + knots[2 : count + 2] + knots[3 : count + 3]) / 3.0
    return Spline(knots, np.stack([points, np.zeros(count)], axis=1))


def test_derivatives_are_limits_of_differences():
    spline = Spline(
        np.array([0, 0, 0, 0, 0.7, 1.5, 2, 2, 2, 2.0]),
        np.array([(0, 0), (1, 2), (2, -1), (3, 1), (4, 0), (5, 2.0)]),
    )
    at, step = np.linspace(0.1, 1.9, 37), 1e-6
    differences = (spline.evaluate(at + step) - spline.evaluate(at - step)) / (2.0 * step)
    np.testing.assert_allclose(spline.derivative(at), differences, atol=1e-7)


def test_parameters_beyond_the_ends_give_the_ends():
    spline = straight()
    np.testing.assert_allclose(spline.evaluate([-1.0, 3.0]), [(0.0, 0.0), (2.0, 0.0)])


@pytest.mark.parametrize(
    ("knots", "points"),
    [
        ([0, 0, 0, 0, 1, 1, 1, 1], [(0, 0)] * 3),
        ([0, 0, 0, 0, 1, 1, 1], [(0, 0)] * 4),
        ([0, 0, 0, 0, 1, 1, 1, 0.5], [(0, 0)] * 4),
        ([0, 0, 0, 0, 0, 0, 0, 0], [(0, 0)] * 4),
        ([0, 0, 0, 0, 1, 1, 1, 1], [(0, math.nan)] * 4),
    ],
)
def test_what_is_no_curve_is_refused(knots, points):
    with pytest.raises(ValueError, match=r"want|finite"):
        Spline(np.array(knots, np.float64), np.array(points, np.float64))


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


SHARES = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20)


@given(splines(), SHARES)
def test_curve_and_derivatives_are_those_of_scipy(spline, shares):
    at = np.append(within(spline, shares), spline.knots[3:-3])
    reference = BSpline(spline.knots, spline.control_points, 3)
    # The second derivative jumps at knots where they are double; within the domain of these they are single.
    for order, mine in enumerate((spline.evaluate(at), spline.derivative(at), spline.derivative(at, 2))):
        expected = reference(at, nu=order)
        np.testing.assert_allclose(mine, expected, rtol=1e-11, atol=1e-12 * max(1.0, np.abs(expected).max()))


@given(splines(), SHARES)
def test_basis_sums_to_one_and_is_local(spline, shares):
    at = np.append(within(spline, shares), spline.knots[3:-3])
    matrix = _basis_matrix(spline.knots, at)
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0, atol=1e-13)
    assert (matrix >= -1e-15).all()
    assert (np.count_nonzero(matrix, axis=1) <= ORDER).all()
    np.testing.assert_allclose(matrix, BSpline.design_matrix(at, spline.knots, 3).toarray(), atol=1e-12)


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


LINE = Spline(np.array([0.0] * 4 + [1.0] * 4), np.stack([np.linspace(1.0, 2.0, 4), np.zeros(4)], axis=1))


def test_a_ray_along_a_straight_wall_meets_its_nearer_end():
    assert LINE.ray((0.0, 0.0), 0.0) == 1.0


@given(st.integers(0, 2**31))
def test_a_shallow_ray_meets_the_nearest_of_all_crossings(seed):
    draws = np.random.default_rng(seed)
    count = int(draws.integers(4, 6))
    control_points = np.stack([np.linspace(0.0, 6.0, count), draws.uniform(-0.3, 0.3, count)], axis=1)
    spline = Spline(np.array([0.0] * 4 + [3.0] * (count - 4) + [6.0] * 4), control_points)
    x, y, direction = -1.0, draws.uniform(-0.3, 0.3), draws.uniform(-0.05, 0.05)
    gaps = spline.evaluate(np.linspace(0.0, 6.0, 6001)) - (x, y)
    ahead = math.cos(direction) * gaps[:, 0] + math.sin(direction) * gaps[:, 1]
    aside = math.cos(direction) * gaps[:, 1] - math.sin(direction) * gaps[:, 0]
    crossings = np.flatnonzero(aside[:-1] * aside[1:] < 0.0)
    found = spline.ray((x, y), direction)
    if len(crossings):
        first = crossings[np.argmin(ahead[crossings])]
        low, high = sorted(ahead[first : first + 2])
        assert low - 1e-6 <= found <= high + 1e-6
    elif np.abs(aside).min() > 1e-6:
        assert found == math.inf
