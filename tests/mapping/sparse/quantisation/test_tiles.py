"""Points in tiles."""

import numpy as np
import pytest
from scattered_points import room

from lidarium.mapping.sparse.quantisation.tiles import GROUP, TILE, tiles_of


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
