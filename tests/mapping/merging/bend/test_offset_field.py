"""Offsets between nodes of a coarse grid."""

import numpy as np
import pytest

from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.merging.bend.offset_field import OffsetField, bilinear


def field(seed=0):
    generator = np.random.default_rng(seed)
    return OffsetField((-1.0, 2.0), 1.5, generator.normal(0.0, 0.05, (4, 5, 2)))


def test_offsets_are_bilinear_between_nodes_and_those_of_the_rim_beyond():
    one = field()
    points = np.random.default_rng(1).uniform(-4.0, 10.0, (200, 2))
    nodes, weights = bilinear(points, one.corner, one.spacing_m, one.offsets.shape[:2])
    plain = (weights[..., None] * one.offsets.reshape(-1, 2)[nodes]).sum(axis=1)
    np.testing.assert_allclose(one.at(points), plain, atol=1e-12)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(one.at(np.array([[0.5, 2.0]]))[0], one.offsets[0, 1])


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (3, 1)])
def test_grids_of_one_row_or_column_have_offsets_too(shape):
    one = OffsetField((0.0, 0.0), 1.0, np.random.default_rng(2).normal(size=(*shape, 2)))
    points = np.random.default_rng(3).uniform(-1.0, 5.0, (50, 2))
    nodes, weights = bilinear(points, one.corner, 1.0, shape)
    plain = (weights[..., None] * one.offsets.reshape(-1, 2)[nodes]).sum(axis=1)
    np.testing.assert_allclose(one.at(points), plain, atol=1e-12)


def test_what_is_bent_is_unbent_to_a_millimetre():
    one, motion = field(), Transform(3.0, -2.0, 0.7)
    points = np.random.default_rng(4).uniform(0.0, 6.0, (100, 2))
    np.testing.assert_allclose(one.unbent(motion, one.bent(motion, points)), points, atol=1e-3)
