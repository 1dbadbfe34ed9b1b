"""What a policy may read of what one robot knows."""

import numpy as np
import pytest
from driven_robots import driven


def test_what_a_belief_hands_out_of_poses_is_a_copy():
    env = driven()
    belief = env.belief("robot_0")
    belief.pose[:] = 99.0
    belief.velocity[:] = 99.0
    assert abs(env.world.poses[0, 0]) < 90.0
    assert env.world.velocities[0, 0] < 1.0


def test_an_agent_that_is_not_on_the_team_has_no_belief():
    with pytest.raises(ValueError, match="robot_9"):
        driven(0).belief("robot_9")


def test_a_belief_is_of_its_own_robot():
    env = driven(10)
    belief = env.belief("robot_1")
    assert belief.pose[:2] + env.perception.offsets[1] == pytest.approx(env.beliefs.believed[1, :2])
    assert (belief.radius, belief.lidar) == (env.settings.robot.radius, env.settings.lidar)
    assert np.array_equal(belief.map.log_odds, env.beliefs.log_odds[1])
    assert belief.goal is None
    assert belief.energy_left_j is None
    assert not belief.spread.any()
