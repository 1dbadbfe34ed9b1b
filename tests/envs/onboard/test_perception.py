"""What a robot knows: its pose and map, the team's map, and nothing of the truth."""

import numpy as np
import pytest

import lidarium
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.grids.occupancy import three_levels


def driven(steps=30, **options):
    env = lidarium.parallel_env(
        "building:5", **{"robots": 3, "stop_coverage": None, "map_cells": 64, **options}
    )
    env.reset(seed=2)
    generator = np.random.default_rng(0)
    for _ in range(steps):
        env.step({agent: generator.uniform(-0.2, 1.0, 2).astype(np.float32) for agent in env.agents})
    return env


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
        seen = env._observations.of([agent])[agent]["map"][0]
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


def test_a_new_episode_forgets_all_maps():
    env = driven()
    old = env.belief("robot_0").shared_map
    env.reset(seed=3)
    new = env.belief("robot_0").shared_map
    assert new is not old
    total = np.sum([log_odds.astype(int) for log_odds in env.beliefs.log_odds], axis=0)
    assert np.array_equal(new.log_odds, np.clip(total, -127, 127))
