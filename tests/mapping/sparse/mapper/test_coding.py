"""Codes of weighted points."""

import numpy as np
import pytest
from scattered_points import room

from lidarium.mapping.sparse.mapper.coding import coded


def test_every_code_has_points_and_every_point_its_nearest_code():
    points = room(600).astype(np.float64)
    codes, labels = coded(points, np.ones(600), 20, 3)
    assert codes.shape == (20, 3)
    assert set(labels.tolist()) == set(range(20))
    gaps = np.linalg.norm(points[:, None] - codes, axis=2)
    np.testing.assert_allclose(gaps[np.arange(600), labels], gaps.min(axis=1), atol=1e-5)


def test_fewer_points_than_codes_are_codes_themselves():
    points = np.array([[0.0, 0, 0], [1.0, 2, 3], [4.0, 4, 4]])
    codes, labels = coded(points, np.ones(3), 50, 0)
    np.testing.assert_allclose(codes[labels], points)
    assert sorted(labels.tolist()) == [0, 1, 2]


def test_heavy_points_draw_codes_to_them_and_the_seed_decides():
    points = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    codes, _ = coded(points, np.array([1.0, 9.0]), 1, 0)
    assert codes[0, 0] == pytest.approx(0.9)
    cloud = room(300).astype(np.float64)
    first, again, other = (coded(cloud, np.ones(300), 9, seed)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
