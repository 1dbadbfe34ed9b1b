"""What quantisation gives of codes whose nearest points are known."""

import numpy as np
import pytest
from scattered_points import room, searched

from lidarium.mapping.sparse.quantisation.lloyd import nearest_codes
from lidarium.mapping.sparse.quantisation.quantisation import quantisation_of
from lidarium.mapping.sparse.quantisation.tiles import tiles_of


def quantised(points, codes, weights=None):
    tiles, codes = tiles_of(points, weights), np.asarray(codes, np.float32)
    return quantisation_of(tiles, codes, nearest_codes(tiles, codes))


def test_labels_are_in_the_callers_order():
    points = room(900)
    codes = points[[1, 50, 300, 899]]
    np.testing.assert_array_equal(quantised(points, codes).labels, searched(points, codes)[0])


def test_errors_are_weighted_means_over_all_points():
    points = np.array([[1.0, 0, 0], [0.0, 2, 0], [10.0, 0, 0]], np.float32)
    found = quantised(points, [[0.0, 0, 0], [10.0, 0, 0]], np.array([1.0, 1.0, 2.0]))
    assert (found.phi1, found.phi2) == pytest.approx((3.0 / 4.0, 5.0 / 4.0))
    assert found.counts.tolist() == [2, 1]
    assert found.rho.tolist() == [2.0, 0.0]


def test_a_code_without_points_is_its_own_box_without_a_normal():
    found = quantised(room(100), [[0.0, 0, 0], [90.0, 80.0, 70.0]])
    assert found.boxes[1].tolist() == [[90.0, 80.0, 70.0]] * 2
    assert np.isnan(found.normals[1]).all()
    assert found.counts.tolist() == [100, 0]


def test_normals_point_upwards_and_two_points_have_none():
    generator = np.random.default_rng(0)
    floor = generator.uniform(-1.0, 1.0, (80, 3)) * [1.0, 1.0, 0.0]
    wall = generator.uniform(-1.0, 1.0, (80, 3)) * [0.0, 1.0, 1.0] + [50.0, 0, 0]
    two = np.array([[0.0, 90.0, 0.0], [1.0, 90.0, 0.0]])
    points = np.concatenate([floor, wall, two]).astype(np.float32)
    found = quantised(points, [[0.0, 0, 0], [50.0, 0, 0], [0.5, 90.0, 0.0]])
    np.testing.assert_allclose(found.normals[:2], [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)], atol=1e-6)
    assert np.isnan(found.normals[2]).all()
