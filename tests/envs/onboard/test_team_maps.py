"""The team's map, and each robot's own."""

import numpy as np
from driven_robots import driven

from lidarium.mapping.grids.occupancy import three_levels


def test_the_shared_map_is_the_sum_of_all_robots_log_odds_cut_to_a_byte():
    env = driven()
    total = np.sum([log_odds.astype(int) for log_odds in env.beliefs.log_odds], axis=0)
    shared = env.belief("robot_0").shared_map
    assert np.array_equal(shared.log_odds, np.clip(total, -127, 127))
    assert env.belief("robot_2").shared_map is shared
    assert (three_levels(shared.log_odds) == 255).sum() > (three_levels(env.beliefs.log_odds[0]) == 255).sum()


def test_a_lone_robots_shared_map_is_its_own():
    env = driven(robots=1)
    belief = env.belief("robot_0")
    assert belief.shared_map is belief.map
