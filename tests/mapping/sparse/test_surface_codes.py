"""A wide box counts as points on its plane, a code of no surface as itself."""

from dataclasses import replace

import numpy as np
import pytest

from lidarium.mapping.sparse.sparse_map import SparseMap, free_codes, occupied_codes
from lidarium.mapping.sparse.surface_codes import codes_of

WALL = np.array([[[0.0, 0.0, 0.0], [2.0, 0.2, 1.0]]])


def with_normal(normal, weight=80.0):
    codes = replace(occupied_codes(WALL), normals=np.array([normal]), weights=np.array([weight]))
    return SparseMap(occupied=codes, ground=free_codes(np.zeros((1, 3))))


def test_a_wall_is_spread_over_its_plane():
    tilted = np.array([0.05, 1.0, 0.0]) / np.hypot(0.05, 1.0)
    codes = codes_of(with_normal(tilted), spacing=0.25)
    spread = codes.centres[:-1]
    assert len(spread) == 8 * 4
    np.testing.assert_allclose((spread - WALL[0].mean(axis=0)) @ tilted, 0.0, atol=1e-12)
    assert ((spread >= WALL[0, 0]) & (spread <= WALL[0, 1])).all()
    assert codes.weights[:-1].sum() == pytest.approx(80.0)


def test_what_of_a_plane_leaves_its_box_is_left_out():
    steep = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    spread = codes_of(with_normal(steep), spacing=0.1).centres[:-1]
    assert ((spread > WALL[0, 0] - 0.021) & (spread < WALL[0, 1] + 0.021)).all()


def test_a_code_of_no_surface_stays_one_point():
    codes = codes_of(with_normal([0.0, 0.0, 0.0]))
    np.testing.assert_array_equal(codes.centres, [WALL[0].mean(axis=0), [0.0, 0.0, 0.0]])
    np.testing.assert_array_equal(codes.normals, [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def test_a_map_of_floor_alone_has_its_free_codes():
    codes = codes_of(
        SparseMap(occupied=occupied_codes(np.empty((0, 2, 3))), ground=free_codes(np.ones((3, 3))))
    )
    assert codes.weights.tolist() == [1.0, 1.0, 1.0]
