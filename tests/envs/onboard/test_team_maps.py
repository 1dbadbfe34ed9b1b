"""The team's map, and each robot's own."""

import numpy as np
import pytest
from driven_robots import driven

from lidarium.envs.onboard.team_maps import _sum_maps
from lidarium.envs.simulation.kernels.arrays import MAP
from lidarium.mapping.grids.occupancy import three_levels


def test_the_shared_map_is_the_sum_of_all_robots_log_odds_cut_to_a_byte():
    env = driven()
    total = np.sum([log_odds.astype(int) for log_odds in env.beliefs.log_odds], axis=0)
    shared = env.belief("robot_0").shared_map
    assert np.array_equal(shared.log_odds, np.clip(total, -127, 127))
    assert env.belief("robot_2").shared_map is shared
    assert (three_levels(shared.log_odds) == 255).sum() > (three_levels(env.beliefs.log_odds[0]) == 255).sum()


@pytest.mark.parametrize("columns", [3, 100])
@pytest.mark.parametrize("order", [1, -1])
def test_sums_are_clipped_once_so_the_order_of_robots_does_not_matter(columns, order):
    values = [-40, -40, -40, -40, 70, 70][::order]
    grids = [np.full((2, columns), value, np.int8) for value in values]
    beliefs = np.zeros((6, 3), np.int64)
    beliefs[:, MAP] = [grid.ctypes.data for grid in grids]
    total = np.zeros((2, columns), np.int8)
    _sum_maps(beliefs, (0, 2, 0, columns), total)
    assert (total == -20).all()


def test_a_lone_robots_shared_map_is_its_own():
    env = driven(robots=1)
    belief = env.belief("robot_0")
    assert belief.shared_map is belief.map
