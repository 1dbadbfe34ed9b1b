"""Normals of the surfaces on which the points of a scan lie."""

import math

import numpy as np
import pytest

from lidarium.mapping.localization.matching.surface_normals import find_normals


def normals_of(points, reach=0.3):
    normals = np.zeros((len(points), 2))
    find_normals(np.ascontiguousarray(points, np.float64), reach, normals)
    return normals


def wall(begin, end, count):
    share = np.linspace(0.0, 1.0, count)[:, None]
    return np.asarray(begin) * (1.0 - share) + np.asarray(end) * share


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.5, -2.2])
def test_points_of_a_wall_have_its_normal_though_noise_moves_them(angle):
    along = np.array([math.cos(angle), math.sin(angle)])
    across = np.array([-along[1], along[0]])
    points = 2.0 * across + np.linspace(-1.0, 1.0, 41)[:, None] * along
    noisy = points + 0.004 * np.random.default_rng(1).normal(size=points.shape)
    assert np.abs(normals_of(points) @ along).max() < 1e-9
    found = normals_of(noisy)
    np.testing.assert_allclose(np.hypot(*found.T), 1.0)
    wide, narrow = np.abs(found @ along), np.abs(normals_of(noisy, 0.06) @ along)
    assert wide.max() < 0.15
    assert np.sqrt((wide**2).mean()) < 0.5 * np.sqrt((narrow**2).mean())


def test_a_corner_is_not_smeared_over_its_walls():
    points = np.vstack([wall((2.0, -1.0), (2.0, 1.0), 41), wall((1.95, 1.0), (0.0, 1.0), 40)])
    found = np.abs(normals_of(points))
    np.testing.assert_allclose(found[:34], np.tile((1.0, 0.0), (34, 1)), atol=1e-6)
    np.testing.assert_allclose(found[-33:], np.tile((0.0, 1.0), (33, 1)), atol=1e-6)
    # At the corner itself the two neighbours give the diagonal.
    assert found[40] == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)))


def test_surfaces_end_at_gaps():
    points = np.vstack([wall((1.0, -0.5), (1.0, 0.0), 6), wall((3.0, 0.1), (3.5, 0.1), 6)])
    found = np.abs(normals_of(points, 5.0))
    np.testing.assert_allclose(found[:6], np.tile((1.0, 0.0), (6, 1)), atol=1e-9)
    np.testing.assert_allclose(found[6:], np.tile((0.0, 1.0), (6, 1)), atol=1e-9)


def test_a_point_alone_has_no_normal_and_two_have_that_of_their_line():
    assert normals_of([(1.0, 2.0)]).tolist() == [[0.0, 0.0]]
    assert normals_of([(1.0, 0.0), (9.0, 0.0)]).tolist() == [[0.0, 0.0]] * 2
    assert np.abs(normals_of([(1.0, 0.0), (1.1, 0.0)])).tolist() == [[0.0, 1.0]] * 2
    assert normals_of(np.zeros((0, 2))).shape == (0, 2)
