"""Rigid motions of the plane."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.geometry.rigid import (
    Transform,
    composed,
    fit,
    halfway,
    relative,
    turned,
    wrapped,
)

POSES = st.builds(Transform, st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.1, 3.1))


def is_close(first, second, tolerance=1e-7):
    return max(first.difference(second)) <= tolerance


@given(POSES, POSES, POSES)
def test_transforms_are_a_group(a, b, c):
    assert is_close((a @ b) @ c, a @ (b @ c), 1e-8)
    assert is_close(a @ a.inverse(), Transform(), 1e-8)
    np.testing.assert_allclose((a @ b).apply((1.0, 2.0)), a.apply(b.apply((1.0, 2.0))), atol=1e-8)


def test_a_point_turns_counter_clockwise():
    np.testing.assert_allclose(
        Transform(1.0, -2.0, math.radians(30.0)).apply((1.0, 0.0)), (1.0 + math.sqrt(0.75), -1.5)
    )


@pytest.mark.parametrize(
    ("angle", "expected"),
    [
        (math.pi, math.pi),
        (-math.pi, math.pi),
        (3.5 * math.pi, -0.5 * math.pi),
        (0.25, 0.25),
        (-7.0, math.tau - 7.0),
    ],
)
def test_angles_are_wrapped_into_a_turn_that_holds_pi(angle, expected):
    assert wrapped(angle) == pytest.approx(expected)


def test_the_difference_of_angles_goes_the_short_distance_past_pi():
    first, second = Transform(theta=math.pi - 0.1), Transform(theta=0.1 - math.pi)
    assert first.difference(second)[1] == pytest.approx(0.2)
    assert abs(halfway(first, second, (0.0, 0.0)).theta) == pytest.approx(math.pi)


@given(POSES)
def test_least_squares_find_the_transform_of_exact_pairs(pose):
    points = np.random.default_rng(0).uniform(0.0, 10.0, (7, 2))
    assert is_close(fit(points, pose.apply(points)), pose)


def test_one_point_is_fitted_by_a_mere_translation():
    assert fit(np.full((3, 2), 1.0), np.full((3, 2), 4.0)) == Transform(3.0, 3.0, 0.0)


def test_least_squares_want_pairs():
    with pytest.raises(ValueError, match="shapes"):
        fit(np.zeros((0, 2)), np.zeros((0, 2)))
    with pytest.raises(ValueError, match="shapes"):
        fit(np.zeros((2, 2)), np.zeros((3, 2)))


@given(POSES, POSES)
def test_half_way_lies_between(a, b):
    middle = halfway(a, b, (1.0, 1.0))
    np.testing.assert_allclose(middle.apply((1.0, 1.0)), 0.5 * (a.apply((1.0, 1.0)) + b.apply((1.0, 1.0))), atol=1e-9)
    assert middle.difference(a)[1] == pytest.approx(middle.difference(b)[1], abs=1e-9)


def test_arrays_of_poses_compose_as_transforms_do():
    generator = np.random.default_rng(3)
    outer, inner = (generator.uniform(-4.0, 4.0, (20, 3)) for _ in range(2))
    found = composed(outer, inner)
    for row, first, second in zip(found.tolist(), outer.tolist(), inner.tolist(), strict=True):
        assert is_close(Transform(*row), Transform(*first) @ Transform(*second), 1e-9)
    assert (np.abs(found[:, 2]) <= math.pi).all()
    np.testing.assert_allclose(composed(outer, relative(outer, found)), found, atol=1e-9)


def test_a_quarter_turn_exchanges_the_axes():
    found = turned(np.diag([1.0, 4.0, 9.0]), math.pi / 2.0)
    np.testing.assert_allclose(found, np.diag([4.0, 1.0, 9.0]), atol=1e-12)


def test_drawn_errors_have_the_turned_covariance():
    generator = np.random.default_rng(1)
    factor = generator.normal(size=(3, 3))
    errors = generator.normal(size=(100_000, 3)) @ factor.T
    elsewhere = np.column_stack([Transform(theta=0.7).apply(errors[:, :2]), errors[:, 2]])
    expected = np.cov(elsewhere.T)
    np.testing.assert_allclose(turned(factor @ factor.T, 0.7), expected, atol=0.03 * np.abs(expected).max())


def test_turning_back_undoes_a_turn():
    matrix = np.array([[2.0, 0.3, 0.1], [0.3, 1.0, -0.2], [0.1, -0.2, 0.5]])
    np.testing.assert_allclose(turned(turned(matrix, 1.1), -1.1), matrix)
