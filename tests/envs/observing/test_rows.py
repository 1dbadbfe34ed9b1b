"""Named arrays over the robots of all episodes."""

import numpy as np
import pytest
from driven_robots import driven

from lidarium.envs.observing.rows import Rows
from lidarium.envs.simulation.kernels.arrays import ENDED


@pytest.fixture(scope="module")
def env():
    return driven(10)


def test_poses_are_in_the_frames_of_the_robots_maps(env):
    rows = Rows(env.simulation, env.settings, env.perception.poses)
    for row, agent in enumerate(env.possible_agents):
        assert rows.pose[row] == pytest.approx(env.belief(agent).pose)
    assert np.array_equal(Rows(env.simulation, env.settings).pose, env.beliefs.believed)


def test_a_map_says_of_the_cell_of_its_robot_that_it_is_free(env):
    rows = Rows(env.simulation, env.settings)
    for log_odds, (row, column) in zip(rows.log_odds, rows.map_cell, strict=True):
        assert log_odds[row, column] < 0


def test_figures_of_the_team_are_there_for_each_robot(env):
    rows = Rows(env.simulation, env.settings)
    assert rows.coverage.tolist() == [env.scorer.coverage] * 3
    assert rows.time_s.tolist() == pytest.approx([env.scorer.time] * 3)
    area = env.settings.occupancy.resolution**2
    assert rows.floor_m2.tolist() == pytest.approx([env.score.counted[0] * area] * 3)
    assert (rows.seen_m2 <= rows.floor_m2).all()
    assert not rows.is_covered.any()
    assert np.array_equal(rows.poses, rows.true_pose)


def test_who_has_ended_is_not_live():
    env = driven(1)
    env.world.flags[1] |= ENDED
    assert Rows(env.simulation, env.settings).live.tolist() == [True, False, True]


def test_rewards_know_nothing_of_teammates_and_private_names_are_none(env):
    rows = Rows(env.simulation, env.settings)
    with pytest.raises(ValueError, match="teammates are known to observables only"):
        assert rows.teammates
    with pytest.raises(AttributeError):
        assert rows._nothing
