"""Lengths, turning and dispersion of paths whose values are known."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarium.mapping.sparse.planning.path_measures import measure_path, points_along


def test_a_straight_line_does_not_turn():
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    found = measure_path(line)
    assert found.length == 3.0
    assert found.points == 3
    assert found.turning == pytest.approx(0.0, abs=1e-9)
    # Evenly spaced on a line: its length over the root of 12, for many points.
    assert found.dispersion == pytest.approx(3.0 / math.sqrt(12.0), rel=0.03)


def test_a_right_angle_turns_by_a_right_angle():
    corner = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    assert measure_path(corner).turning == pytest.approx(math.pi / 2.0)
    assert measure_path(corner, None).turning == pytest.approx(math.pi / 2.0)
    assert measure_path(corner).length == 3.0


def test_a_turn_back_is_half_a_turn_and_standing_is_none():
    back = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    assert measure_path(back, None).turning == pytest.approx(math.pi)
    still = measure_path(np.zeros((1, 3)))
    assert (still.length, still.turning, still.dispersion) == (0.0, 0.0, 0.0)


@given(st.lists(st.tuples(*[st.floats(-5.0, 5.0)] * 2), min_size=2, max_size=12))
def test_measures_equal_the_formulas_point_by_point(corners):
    path = np.array(corners)
    found = measure_path(path, None)
    turning = 0.0
    steps = [b - a for a, b in itertools.pairwise(path) if np.linalg.norm(b - a) > 1e-12]
    for first, second in itertools.pairwise(steps):
        cosine = first @ second / (np.linalg.norm(first) * np.linalg.norm(second))
        turning += math.acos(min(max(cosine, -1.0), 1.0))
    assert found.turning == pytest.approx(turning, abs=1e-6)
    mean = path.mean(axis=0)
    squares = sum(float((point - mean) @ (point - mean)) for point in path)
    assert found.dispersion == pytest.approx(math.sqrt(squares / (len(path) - 1)))


def test_points_are_spaced_evenly_and_the_ends_stay():
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    points = points_along(path, 0.3)
    assert points[0].tolist() == [0.0, 0.0]
    assert points[-1].tolist() == [1.0, 1.0]
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= 0.3


@pytest.mark.parametrize("path", [np.empty((0, 2)), np.array([[0.0, math.nan]]), np.zeros(3)])
def test_what_is_no_path_is_refused(path):
    with pytest.raises(ValueError, match="the path has shape"):
        measure_path(path)
