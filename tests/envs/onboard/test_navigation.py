"""Clearance and frontiers are kept up to date."""

import numpy as np
import pytest
from driven_robots import driven

from lidarium.envs.onboard.navigation import NavigationMap


def same_navigation(one, other):
    assert np.array_equal(one.frontiers.flags, other.frontiers.flags)
    assert np.array_equal(one.clearance.closeness, other.clearance.closeness)


@pytest.mark.parametrize("known_starts", [True, False])
def test_clearance_and_frontiers_kept_up_to_date_are_those_of_the_whole_map(known_starts):
    env = driven(0, known_starts=known_starts, noise="datasheet")
    beliefs = [env.belief(agent) for agent in env.agents]
    generator = np.random.default_rng(1)
    for step in range(40):
        env.step({agent: generator.uniform(-0.2, 1.0, 2).astype(np.float32) for agent in env.agents})
        if step % 7 == 0 or step == 39:
            maps = [belief.map for belief in beliefs]
            maps += [beliefs[0].shared_map] if known_starts else []
            for kept in maps:
                fresh = NavigationMap(kept.log_odds.copy(), kept.resolution)
                fresh.changed((0, kept.log_odds.shape[0], 0, kept.log_odds.shape[1]))
                same_navigation(kept, fresh)


def test_maps_first_asked_for_late_are_the_same_as_those_asked_for_from_the_start():
    early, late = driven(0), driven(0)
    assert early.belief("robot_1").shared_map is not None
    generator = np.random.default_rng(1)
    for _ in range(25):
        actions = {agent: generator.uniform(-0.2, 1.0, 2).astype(np.float32) for agent in early.agents}
        early.step(actions)
        assert early.belief("robot_1").shared_map is not None
        late.step(actions)
    for get in (
        lambda env: env.belief("robot_1").shared_map,
        lambda env: env.belief("robot_1").map,
    ):
        one, other = get(early), get(late)
        assert np.array_equal(one.log_odds, other.log_odds)
        same_navigation(one, other)
