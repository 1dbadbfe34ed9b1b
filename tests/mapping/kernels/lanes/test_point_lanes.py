"""Nearest codes of a tile are those of a plain search."""

import numpy as np

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python.plain import nearest_codes
from lidarium.mapping.kernels.lanes.point_lanes import TILE, nearest_in_tile


@kernel
def lowered(points, codes, numbers, squares, labels):
    nearest_in_tile(
        points.ctypes.data,
        codes.ctypes.data,
        numbers.ctypes.data,
        codes.shape[0],
        squares.ctypes.data,
        labels.ctypes.data,
    )


def test_the_nearest_codes_are_those_of_a_plain_search():
    generator = np.random.default_rng(0)
    for count in (1, 2, 7, 40):
        points = generator.normal(size=(3, TILE)).astype(np.float32)
        codes = generator.normal(size=(count, 3)).astype(np.float32)
        codes[-1] = codes[0]  # of equal codes the first stays
        numbers = generator.permutation(100)[:count].astype(np.int32)
        squares = generator.uniform(0.0, 2.0, TILE).astype(np.float32)
        labels = np.full(TILE, -1, np.int32)
        expected = nearest_codes(points, codes, numbers, (squares, labels))
        lowered(points, codes, numbers, squares, labels)
        assert (squares == expected[0]).all()
        assert (labels == expected[1]).all()
