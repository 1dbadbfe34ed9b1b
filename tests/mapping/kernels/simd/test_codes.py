"""Nearest codes of the points of a tile."""

import numpy as np
from both_forms import assert_forms_agree

from lidarium.mapping.kernels.simd.codes import TILE, nearest_in_tile


def test_the_nearest_codes_are_those_of_an_exhaustive_search():
    generator = np.random.default_rng(0)
    for count in (0, 1, 2, 7, 40):
        points = generator.normal(size=(3, TILE)).astype(np.float32)
        codes = generator.normal(size=(count, 3)).astype(np.float32)
        codes[-1:] = codes[:1]  # of equal codes the first stays
        numbers = np.arange(count, dtype=np.int32)
        squares = np.full(TILE, np.inf, np.float32)
        labels = np.full(TILE, -1, np.int32)
        found = assert_forms_agree(nearest_in_tile, points, codes, numbers, count, squares, labels)[-1]
        if count:
            distances = ((points.T[:, None] - codes) ** 2).sum(axis=2)
            assert np.array_equal(found, np.argmin(distances, axis=1))
