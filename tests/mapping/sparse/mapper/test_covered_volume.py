"""How much of a box is in no other box."""

import numpy as np
import pytest

from lidarium.mapping.sparse.mapper.covered_volume import MOST_PIECES, uncovered_volume
from lidarium.mapping.sparse.mapper.explained_points import are_covered


def random_boxes(count, seed, extent=3.0):
    rng = np.random.default_rng(seed)
    low = rng.uniform(0.0, extent, (count, 3)) * [1.0, 1.0, 0.3]
    return np.stack([low, low + rng.uniform(0.0, 0.5, (count, 3))], axis=1)


@pytest.mark.parametrize("seed", range(4))
def test_the_uncovered_volume_is_exact(seed):
    boxes = random_boxes(12, seed, extent=0.7).reshape(-1, 6)
    around = np.array([0.1, 0.1, 0.05, 0.9, 0.8, 0.5])
    room = np.empty((MOST_PIECES, 6)), np.empty(MOST_PIECES, np.int64)
    found = uncovered_volume(around, 0.05, boxes, np.inf, *room)
    points = np.random.default_rng(seed).uniform(around[:3] - 0.05, around[3:] + 0.05, (40_000, 3))
    wide = boxes.reshape(-1, 2, 3) + np.array([[[-0.05], [0.05]]])
    share = 1.0 - are_covered(points, wide).mean()
    assert found == pytest.approx(share * np.prod(around[3:] - around[:3] + 0.1), abs=0.01)
