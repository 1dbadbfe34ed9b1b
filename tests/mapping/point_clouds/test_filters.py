"""Filters keep the points that they say."""

import math

import numpy as np
import pytest
from small_clouds import cloud

from lidarium.mapping.point_clouds.filters import finite, within_range, without_lonely


def test_the_range_gate_counts_from_the_sensor():
    found = within_range(cloud((4, 0, 0), (6, 0, 0), (math.nan, 0, 0)), 4.0, 0.5, origin=(2.0, 0.0, 0.0))
    assert found.points[:, 0].tolist() == [4.0, 6.0]
    assert within_range(cloud((4, 0, 0), (0.1, 0, 0)), 3.0, 0.5).points.size == 0


def test_points_that_are_not_finite_are_dropped_with_what_is_known_of_them():
    found = finite(cloud((0, 0, 0), (math.inf, 0, 0), (0, math.nan, 0), (1, 1, 1), weights=np.arange(4)))
    assert found.weights.tolist() == [0.0, 3.0]


def test_lonely_points_are_dropped():
    points = cloud((0, 0, 0), (0.1, 0, 0), (0.2, 0, 0), (5, 0, 0))
    assert len(without_lonely(points, 0.11)) == 3
    assert without_lonely(points, 0.11, 2).points[:, 0].tolist() == pytest.approx([0.1])
    assert len(without_lonely(points, 0.11, 4)) == 0
