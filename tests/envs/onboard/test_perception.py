"""A new episode begins with nothing known."""

import numpy as np
from driven_robots import driven


def test_a_new_episode_forgets_all_maps():
    env = driven()
    old = env.belief("robot_0").shared_map
    env.reset(seed=3)
    new = env.belief("robot_0").shared_map
    assert new is not old
    total = np.sum([log_odds.astype(int) for log_odds in env.beliefs.log_odds], axis=0)
    assert np.array_equal(new.log_odds, np.clip(total, -127, 127))
