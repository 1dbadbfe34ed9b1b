"""The Morton order of points."""

import numpy as np
import pytest

from lidarium.mapping.sparse.quantisation.morton import CELLS, SPREAD, morton_order


def plain_keys(points, low, per_metre):
    """Keys of cells whose bits alternate, from z down to x."""
    cells = np.clip(((points - np.float32(low)) * np.float32(per_metre)).astype(int), 0, CELLS - 1)
    return [
        sum((int(cell[axis]) >> bit & 1) << (3 * bit + axis) for bit in range(8) for axis in range(3))
        for cell in cells
    ]


@pytest.mark.parametrize("count", [0, 1, 700])
def test_points_are_in_the_order_of_their_keys_and_equal_ones_as_they_came(count):
    generator = np.random.default_rng(count)
    points = generator.uniform(-1.0, 30.0, (count, 3)).astype(np.float32)
    low = np.zeros(3)
    # Some lie before the first cell and beyond the last.
    order = morton_order(points, low, 10.0, SPREAD)
    assert order.tolist() == np.argsort(plain_keys(points, low, 10.0), kind="stable").tolist()


def test_what_follows_in_the_order_is_near_in_space():
    points = np.random.default_rng(0).uniform(0.0, 8.0, (4000, 3)).astype(np.float32)
    order = morton_order(points, np.zeros(3), CELLS / 8.0, SPREAD)
    gaps = np.linalg.norm(np.diff(points[order], axis=0), axis=1)
    assert np.median(gaps) < 0.2 * np.median(np.linalg.norm(np.diff(points, axis=0), axis=1))
