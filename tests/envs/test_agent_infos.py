"""Infos say what a learner may not see, and how the robots operate."""

import pytest
from linked_rooms import TWO_ROOMS

import lidarium
from lidarium.envs.agent_infos import AgentInfos
from lidarium.envs.onboard.meters import Meters
from lidarium.envs.onboard.radio.messages import Order, OrderKind


def team(**options):
    env = lidarium.parallel_env(TWO_ROOMS, robots=2, **options)
    env.reset(seed=0)
    meters = Meters(env.world, env.settings)
    return AgentInfos(env.simulation, env.settings, env.scorer, env.operating, meters), env, meters


def test_the_truth_is_that_of_the_world_at_the_time():
    infos, env, _ = team()
    made = infos.of(["robot_1"])
    assert set(made) == {"robot_1"}
    truth = made["robot_1"]["truth"]
    assert truth["pose"] == pytest.approx(TWO_ROOMS.starts[1])
    assert truth["seen_cells"] == env.score.seen[1] > 0
    assert truth["coverage"] == env.score.coverage(0) > 0.0
    env.world.poses[1] = 7.0
    assert truth["pose"] == pytest.approx(TWO_ROOMS.starts[1])


def test_states_and_orders_are_named():
    infos, env, _ = team()
    env.order("robot_0", Order(OrderKind.PAUSE))
    made = infos.of(env.agents)
    assert [made[agent]["state"] for agent in env.agents] == ["paused", "operating"]
    assert [made[agent]["order"] for agent in env.agents] == ["pause", ""]


def test_terms_are_those_of_the_rewards_that_were_last_taken():
    infos, env, _ = team(reward={"time": 2.0})
    env.drive({agent: [0.0, 0.0] for agent in env.agents})
    assert infos.of(env.agents)["robot_0"]["reward_terms"]["time"] == 0.0
    rewards = env.scorer.take_rewards()
    for row, agent in enumerate(env.agents):
        terms = infos.of(env.agents)[agent]["reward_terms"]
        assert terms["time"] == pytest.approx(-2.0 * 0.1)
        assert sum(terms.values()) == pytest.approx(rewards[row])


def test_energy_and_camera_are_there_where_robots_have_them():
    infos, env, meters = team(battery={"capacity_j": 100.0}, camera="depth_64x48")
    meters.used_j[:] = 3.0, 4.5
    made = infos.of(env.agents)
    assert [made[agent]["energy_j"] for agent in env.agents] == [3.0, 4.5]
    assert made["robot_1"]["camera"]["intrinsics"] == env.settings.camera.calibration["intrinsics"]
    plain, env, _ = team()
    assert not {"energy_j", "camera"} & set(plain.of(env.agents)["robot_0"])
