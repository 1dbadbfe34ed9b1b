"""Short cuts in a path of cells."""

import math

import numpy as np
from searched_beliefs import RESOLUTION, made
from smoothed_paths import line_keeps_clearance, shortened, waypoints

from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import plan


def test_a_free_line_becomes_two_waypoints_and_corners_few_more():
    belief = np.full((100, 100), -5, np.int8)
    space, field = made(belief)
    footprint = Footprint(0.18, 0.33)
    _, path = plan(space, belief, field, (10, 10), (37, 85), footprint)
    np.testing.assert_allclose(
        waypoints(path, belief, field, footprint, origin=(-1.0, 2.0)), [[-0.7375, 2.2625], [1.1375, 2.9375]]
    )
    belief[40:, 40:60] = 9
    field.update(belief)
    _, path = plan(space, belief, field, (80, 20), (80, 80), footprint)
    assert 3 <= len(shortened(path, belief, field, footprint)) <= 10


def test_line_clearance_is_exact():
    belief = np.full((40, 60), -5, np.int8)
    belief[20, 30] = 9
    _, field = made(belief)
    assert line_keeps_clearance((10, 5), (10, 55), belief, field, 9.5 * RESOLUTION)
    assert not line_keeps_clearance((10, 5), (10, 55), belief, field, 9.6 * RESOLUTION)
    corner = (np.array([19.5, 29.5]) - [0, 10]) @ np.array([1, -1]) / math.sqrt(2)
    assert not line_keeps_clearance((0, 10), (29, 39), belief, field, (abs(corner) + 0.01) * RESOLUTION)
    belief[10, 20] = 0
    assert not line_keeps_clearance((10, 5), (10, 55), belief, field, 0.0)
