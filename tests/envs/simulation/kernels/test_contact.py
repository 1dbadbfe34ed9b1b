"""Contact of discs with squares against plain geometry."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.envs.simulation.kernels.contact import deepest_wall, distance_bound

RESOLUTION = 0.025


def hall(rows=160, columns=200):
    solid = np.zeros((rows, columns), np.uint8)
    solid[0], solid[-1], solid[:, 0], solid[:, -1] = 1, 1, 1, 1
    return solid


@given(x=st.floats(0.2, 4.8), y=st.floats(0.2, 3.8), seed=st.integers(0, 1000))
@settings(max_examples=60)
def test_the_deepest_wall_is_the_nearest_square(x, y, seed):
    generator = np.random.default_rng(seed)
    solid = hall() | (generator.random((160, 200)) < 0.01).astype(np.uint8)
    cell_x, cell_y, radius = x / RESOLUTION, y / RESOLUTION, 7.2
    rows, columns = np.nonzero(solid)
    gaps = np.hypot(
        np.maximum(np.maximum(columns - cell_x, cell_x - columns - 1), 0),
        np.maximum(np.maximum(rows - cell_y, cell_y - rows - 1), 0),
    )
    depth, normal_x, normal_y = deepest_wall(solid, cell_x, cell_y, radius)
    assert depth == pytest.approx(max(radius - gaps.min(), 0.0), abs=1e-9)
    if depth > 0.0 and gaps.min() > 0.0:
        assert math.hypot(normal_x, normal_y) == pytest.approx(1.0)


@given(seed=st.integers(0, 1000))
@settings(max_examples=25)
def test_the_distance_bound_never_promises_more_room_than_there_is(seed):
    generator = np.random.default_rng(seed)
    solid = hall(40, 50) | (generator.random((40, 50)) < 0.01).astype(np.uint8)
    bound = distance_bound(solid)
    rows, columns = np.nonzero(solid)
    for _ in range(50):
        x, y = generator.uniform(0, 50), generator.uniform(0, 40)
        gaps = np.hypot(
            np.maximum(np.maximum(columns - x, x - columns - 1), 0),
            np.maximum(np.maximum(rows - y, y - rows - 1), 0),
        )
        assert bound[int(y), int(x)] <= gaps.min() + 1e-9
