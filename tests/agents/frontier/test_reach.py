"""Costs of frontiers to a robot."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.agents.frontier.policies import UtilityFrontier
from lidarium.evaluation.episodes.runner import run_episode


@pytest.mark.parametrize("robots", [1, 3])
@pytest.mark.parametrize("cost_weight", [0.05, 0.4])
def test_frontiers_far_away_are_left_out_only_where_they_change_no_choice(robots, cost_weight, monkeypatch):
    """Looking over the whole floor at once, or ever further where it matters, gives the same run to the
    bit."""

    def choices(first_slack):
        monkeypatch.setattr("lidarium.agents.frontier.policies.FIRST_SLACK", first_slack)
        env = lidarium.parallel_env(
            "building:4",
            robots=robots,
            horizon_s=120.0,
            stop_coverage=None,
            map_cells=32,
            resolution=0.05,
            starts="fixed",
        )
        run_episode(UtilityFrontier(cost_weight=cost_weight), env, 3)
        return env.world.poses

    whole, stepwise, careful = choices(math.inf), choices(0.25), choices(4.0)
    assert np.array_equal(whole, stepwise)
    assert np.array_equal(whole, careful)
