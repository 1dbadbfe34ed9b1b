"""Rewards shared with the team."""

import numpy as np
import pytest

from lidarium.envs.faces.team_rewards import shared_among, shared_rewards


def test_a_share_of_each_reward_is_the_mean_of_those_who_acted():
    rewards = np.array([[1.0, 3.0, 100.0], [2.0, 4.0, 6.0], [5.0, 5.0, 5.0]])
    acted = np.array([[True, True, False], [True, True, True], [False, False, False]])
    found = shared_rewards(rewards, acted, 0.25)
    assert found[0].tolist() == [0.75 * 1.0 + 0.5, 0.75 * 3.0 + 0.5, 0.0]
    assert found[1].tolist() == [2.5, 4.0, 5.5]
    assert found[2].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_sharing_leaves_the_sum_of_the_team(share):
    rewards = {
        f"robot_{k}": value for k, value in enumerate(np.random.default_rng(1).normal(size=5).tolist())
    }
    found = shared_among(rewards, share)
    assert list(found) == list(rewards)
    assert sum(found.values()) == pytest.approx(sum(rewards.values()))
    if share == 1.0:
        assert max(found.values()) == pytest.approx(min(found.values()))
    if share == 0.0:
        assert found == rewards
    assert shared_among({}, share) == {}
