"""The Morton order of points."""

import numpy as np
import pytest
from scattered_points import room

from lidarium.mapping.sparse.quantisation.tiles import CELLS, GROUP, SPREAD, TILE, _morton_order, tiles_of


def plain_keys(points, low, per_metre):
    """Keys of cells whose bits alternate, from z down to x."""
    cells = np.clip(((points - np.float32(low)) * np.float32(per_metre)).astype(int), 0, CELLS - 1)
    return [
        sum((int(cell[axis]) >> bit & 1) << (3 * bit + axis) for bit in range(8) for axis in range(3)) for cell in cells
    ]


@pytest.mark.parametrize("count", [0, 1, 700])
def test_points_are_in_the_order_of_their_keys_and_equal_ones_as_they_came(count):
    generator = np.random.default_rng(count)
    points = generator.uniform(-1.0, 30.0, (count, 3)).astype(np.float32)
    low = np.zeros(3)
    # Some lie before the first cell and beyond the last.
    order = _morton_order(points, low, 10.0, SPREAD)
    assert order.tolist() == np.argsort(plain_keys(points, low, 10.0), kind="stable").tolist()


def test_what_follows_in_the_order_is_near_in_space():
    points = np.random.default_rng(0).uniform(0.0, 8.0, (4000, 3)).astype(np.float32)
    order = _morton_order(points, np.zeros(3), CELLS / 8.0, SPREAD)
    gaps = np.linalg.norm(np.diff(points[order], axis=0), axis=1)
    assert np.median(gaps) < 0.2 * np.median(np.linalg.norm(np.diff(points, axis=0), axis=1))


@pytest.mark.parametrize("count", [1, 63, 64, 65, 1024, 3001])
def test_every_point_is_in_one_tile_and_its_box(count):
    points = room(count)
    tiles = tiles_of(points)
    assert sorted(tiles.order.tolist()) == list(range(count))
    assert tiles.weights.sum() == count
    flat = tiles.points.transpose(0, 2, 1).reshape(-1, 3)[:count]
    assert (flat == points[tiles.order]).all()
    boxes = np.repeat(tiles.boxes, TILE, axis=0)[:count]
    groups = np.repeat(tiles.group_boxes, TILE * GROUP, axis=0)[:count]
    for each in (boxes, groups):
        assert ((flat >= each[:, 0]) & (flat <= each[:, 1])).all()
    assert tiles.sums.sum(axis=0)[:3] == pytest.approx(points.sum(axis=0, dtype=np.float64))


def test_tiles_in_morton_order_are_small():
    points = room(64_000)
    sizes = np.ptp(tiles_of(points).boxes, axis=1)[:, 0]
    assert np.median(sizes) < 0.5
    assert np.median(np.ptp(points.reshape(-1, TILE, 3), axis=1)) > 2.0


@pytest.mark.parametrize("far", [np.nan, np.inf, 2e6])
def test_points_that_can_be_no_metres_are_refused(far):
    points = room(100)
    points[17, 1] = far
    with pytest.raises(ValueError, match="want finite coordinates"):
        tiles_of(points)
