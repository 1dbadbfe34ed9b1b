"""What robots know of where they and the others are."""

import numpy as np
from driven_robots import driven

from lidarium.mapping.grids.occupancy import three_levels


def test_poses_of_all_are_told_in_each_robots_own_frame():
    env = driven()
    for row, agent in enumerate(env.agents):
        belief = env.belief(agent)
        offset = env.perception.poses.offset(row)
        assert np.allclose(belief.pose[:2] + offset, env.world.poses[row, :2])
        assert set(belief.teammates) == set(env.agents) - {agent}
        for name, teammate in belief.teammates.items():
            other = int(name[-1])
            assert np.allclose(teammate.pose[:2] + offset, env.world.poses[other, :2])
            assert teammate.pose[2] == env.world.poses[other, 2]
            assert (teammate.age_s, teammate.radius, teammate.has_ended) == (0.0, 0.18, False)
        assert belief.radius == 0.18
        assert np.array_equal(belief.velocity, env.world.velocities[row])
        assert not belief.spread.any()
        assert belief.goal is None


def test_the_origin_of_the_map_puts_its_cells_where_they_are_in_the_frame():
    env = driven()
    for row, agent in enumerate(env.agents):
        belief = env.belief(agent)
        place = (belief.pose[:2] - belief.map_origin) / belief.map.resolution
        assert belief.map.log_odds[int(place[1]), int(place[0])] < 0
        levels = three_levels(belief.map.log_odds)
        seen = env.engine.observations["map"][row][0]
        i, j = int(place[1]), int(place[0])
        assert np.array_equal(seen[24:40, 24:40], levels[i - 8 : i + 8, j - 8 : j + 8])
        assert row < 3


def test_a_teammate_that_has_ended_is_known_to_have():
    env = driven()
    env.stop("robot_2", "stopped")
    env.step({agent: np.zeros(2, np.float32) for agent in env.agents[:2]})
    assert env.belief("robot_0").teammates["robot_2"].has_ended


def test_with_unknown_starts_nothing_of_the_others_is_known():
    env = driven(known_starts=False)
    belief = env.belief("robot_0")
    assert belief.shared_map is None
    assert belief.teammates == {}
    assert env.belief("robot_1").map is not belief.map


def test_the_table_says_of_teammates_what_their_names_say():
    env = driven(10)
    table = env.perception.poses.table()
    assert table.shape == (3, 2, 8)
    for row, agent in enumerate(env.agents):
        others = list(env.belief(agent).teammates.values())
        assert np.allclose(table[row, :, :3], [other.pose for other in others])
        assert table[row, :, 5:].tolist() == [[0.0, 0.0, 1.0]] * 2


def test_a_table_of_robots_that_know_nobody_is_zeros():
    assert not driven(3, known_starts=False).perception.poses.table().any()
