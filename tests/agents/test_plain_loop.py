"""Policies in a plain loop: a team, some of its robots, every level that carries them out, rows of a batch."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.agents import policy_names

HORIZON_S = 12.0
CAMERA = {"camera": "xtion_tilted", "observe": ("scan", "pose", "depth")}
NEEDS = {"sparse_frontier": CAMERA, "random_walk": {"observe": ("scan", "pose", "bumper")}}
NAMES = sorted(policy_names())
OF_WAYPOINTS = [name for name in NAMES if lidarium.policy(name).level == "waypoint"]


def options_for(name, **more):
    unknown = {"known_starts": False} if "supervised" in name else {}
    if name == "oracle_starts":
        unknown = {"known_starts": False, "reveals_starts": True}
    return {"robots": 3, "horizon_s": HORIZON_S, "map_cells": 64, **unknown, **NEEDS.get(name, {}), **more}


def run(env, policy, seed=3):
    """Run the plain loop to the end; return the poses after each step."""
    observations, _ = env.reset(seed=seed)
    policy.reset(env, seed=seed)
    poses = []
    while env.agents:
        observations, *_ = env.step(policy.act(observations))
        poses.append(env.unwrapped.world.poses.copy())
    return poses


@pytest.mark.parametrize("name", NAMES)
def test_every_policy_runs_in_a_plain_loop_as_run_episode_runs_it(name):
    policy = lidarium.policy(name)
    env = lidarium.parallel_env("apartment", level=policy.level, **options_for(name))
    env.use_level(policy.level, policy.shares_map, policy.decision_period_s)
    poses = run(env, policy)
    other = lidarium.parallel_env("apartment", **options_for(name))
    lidarium.run_episode(lidarium.policy(name), other, seed=3)
    assert len(poses) > 5
    assert np.array_equal(poses[-1], other.world.poses)
    assert env.scorer.curve == other.scorer.curve
    assert env.scorer.ended_because == other.scorer.ended_because


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
@pytest.mark.parametrize("name", ["nearest_frontier", "tour_frontier", "learned", "supervised"])
def test_a_policy_of_waypoints_drives_one_robot_among_others_at_every_level(name, level):
    env = lidarium.parallel_env("apartment", level=level, **options_for(name))
    policy = lidarium.policy(name)
    observations, _ = env.reset(seed=1)
    policy.reset(env, seed=1)
    start = env.world.poses[0, :2].copy()
    others = {agent: env.action_space(agent) for agent in env.agents[1:]}
    for agent, space in others.items():
        space.seed(env.possible_agents.index(agent))
    while env.agents:
        actions = policy.act(observations, agents=["robot_0"]) if "robot_0" in env.agents else {}
        assert set(actions) <= {"robot_0"}
        actions |= {agent: space.sample() for agent, space in others.items() if agent in env.agents}
        observations, *_ = env.step(actions)
        observations = {agent: observations[agent] for agent in env.agents}
    assert np.linalg.norm(env.world.poses[0, :2] - start) > 1.0
    assert env.world.collisions[0] == 0


@pytest.mark.parametrize("name", ["nearest_frontier", "tour_frontier", "supervised"])
def test_a_team_at_the_level_of_velocities_decides_and_drives_as_at_that_of_waypoints(name):
    ended = {}
    for level in ("velocity", "waypoint"):
        policy = lidarium.policy(name)
        env = lidarium.parallel_env("apartment", level=level, **options_for(name, resolution=0.1, horizon_s=60.0))
        if level == "waypoint":
            env.use_level(policy.level, policy.shares_map, policy.decision_period_s)
        run(env, policy)
        ended[level] = env.scorer.time, env.scorer.coverage
    assert ended["velocity"] == pytest.approx(ended["waypoint"], rel=0.05)


@pytest.mark.parametrize("name", ["tour_frontier", "supervised", "srt"])
def test_a_policy_drives_an_episode_of_a_batch_as_it_drives_a_single_environment(name):
    options = options_for(name)
    level = lidarium.policy(name).level
    batch = lidarium.vector_env(2, "apartment", level=level, reports=True, **options)
    policies = [lidarium.policy(name) for _ in range(2)]
    batch.reset(seed=5)
    for episode, policy in enumerate(policies):
        policy.reset(batch.team(episode), seed=5 + episode)
    poses = []
    while not any(batch.batch.is_over):
        teams = [batch.team(episode) for episode in range(2)]
        batch.step([policy.act(team.observations) for policy, team in zip(policies, teams, strict=True)])
        poses.append(batch.engine.world.poses.copy())
    for episode in range(2):
        env = lidarium.parallel_env("apartment", level=level, **options)
        alone = run(env, lidarium.policy(name), seed=5 + episode)
        rows = slice(3 * episode, 3 * episode + 3)
        assert all(np.array_equal(a, b[rows]) for a, b in zip(alone, poses, strict=False))


def test_an_episode_of_a_batch_that_began_again_takes_a_policy_that_began_again():
    batch = lidarium.vector_env(2, "apartment", level="waypoint", robots=1, horizon_s=3.0, map_cells=64)
    policies = [lidarium.policy("nearest_frontier") for _ in range(2)]
    batch.reset(seed=0)
    begun = 0
    for _ in range(12):
        for episode, policy in enumerate(policies):
            if batch.team(episode).time_s == 0.0:
                policy.reset(batch.team(episode), seed=episode)
                begun += 1
        batch.step([policy.act(batch.team(k).observations) for k, policy in enumerate(policies)])
    assert begun >= 4


def test_stops_and_orders_are_actions_of_step_at_every_level():
    for level in ("velocity", "waypoint", "frontier"):
        env = lidarium.parallel_env("apartment", level=level, robots=2, map_cells=64)
        env.reset(seed=0)
        space = env.action_space("robot_1")
        x, y, theta = env.belief("robot_1").pose.tolist()
        near = lidarium.Target(x + 0.4 * math.cos(theta), y + 0.4 * math.sin(theta))
        _, _, terminations, _, infos = env.step(
            {"robot_0": lidarium.Stop("my_reason"), "robot_1": lidarium.Order("go_to", near, "test")}
        )
        assert terminations["robot_0"]
        assert infos["robot_0"]["ended_because"] == "my_reason"
        assert infos["robot_1"]["order"] == "go_to"
        for _ in range(30 if level == "velocity" else 3):
            env.step({})
        assert np.linalg.norm(env.belief("robot_1").pose[:2] - [near.x, near.y]) < 0.15
        env.step({"robot_1": space.sample()})


def test_policies_work_in_wrappers():
    env = lidarium.MergedMaps(
        lidarium.parallel_env("apartment", level="waypoint", **options_for("", known_starts=False))
    )
    assert len(run(env, lidarium.policy("nearest_frontier"))) > 3


@pytest.mark.parametrize(
    ("name", "level", "said"),
    [
        ("srt", "waypoint", "SensorBasedRandomTree decides at the level 'velocity'"),
        ("random_walk", "frontier", "want level='velocity'"),
    ],
)
def test_a_policy_at_a_level_that_does_not_carry_it_out_is_refused(name, level, said):
    env = lidarium.parallel_env("apartment", level=level, robots=1)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=said):
        lidarium.policy(name).reset(env, seed=0)


def test_agents_of_another_team_and_teams_of_another_batch_are_refused():
    env = lidarium.parallel_env("apartment", level="waypoint", robots=1, map_cells=64)
    observations, _ = env.reset(seed=0)
    policy = lidarium.policy("nearest_frontier")
    policy.reset(env)
    with pytest.raises(ValueError, match=r"no observation of 'robot_7'; want agents among \['robot_0'\]"):
        policy.act(observations, agents=["robot_7"])
    batch = lidarium.vector_env(2, "apartment", level="waypoint", robots=1, map_cells=64)
    batch.reset(seed=0)
    with pytest.raises(ValueError, match="actions are of 1 teams; want a dict for each of 2 episodes"):
        batch.step([policy.act(observations)])
    with pytest.raises(ValueError, match="no action for robot_0"):
        batch.step([{}, {}])
    with pytest.raises(ValueError, match="reports=True"):
        lidarium.policy("supervised").reset(batch.team(0))


def test_a_policy_that_reads_depth_is_refused_without_a_camera():
    env = lidarium.parallel_env("apartment", level="waypoint", robots=1)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="camera='xtion_tilted'"):
        lidarium.policy("sparse_frontier").reset(env)
