"""Policies in a plain loop: a team, some of its robots, every level that carries them out, rows of a batch."""

import copy
import math

import numpy as np
import pytest

import lidarium
from lidarium import Floor, Solid, registry
from lidarium.agents import policy_names

HORIZON_S = 12.0
CAMERA = {"camera": {"columns": 80, "rows": 60, "pitch": 0.35}, "observe": ("scan", "pose", "depth")}
SMALL_GRAPH = {"graph": {"spacing": 0.6, "neighbours": 1, "frontier_spacing": 0.2, "least_utility": 0}}
NEEDS = {
    "sparse_frontier": CAMERA,
    "random_walk": {"observe": ("scan", "pose", "bumper")},
    "nearest_node": SMALL_GRAPH,
    "utility_node": SMALL_GRAPH,
    "zoo:ppo-2": {"observe": ("frontier_gains", "teammates")},
    "zoo:tours-2": {"observe": ("teammates",)},
}
ALIKE = {"zoo:ppo-4", "zoo:mappo-2", "zoo:mappo-4", "zoo:signal-2"}
"""Policies that differ from ``zoo:ppo-2`` by their weights alone."""

NAMES = sorted(set(policy_names()) - ALIKE)
LEVELS = ("velocity", "waypoint", "frontier")
CARRIED = [
    (name, level)
    for name in NAMES
    for level, own in ((level, lidarium.policy(name).level) for level in LEVELS)
    if level == own or own in registry("level")[level].carries
]


def _block(x, y, width, depth):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]]), 0.0, 2.0)


TWO_ROOMS = Floor(
    "two_rooms",
    (0.0, 0.0, 7.0, 4.5),
    (_block(3.4, 0.0, 0.2, 1.6), _block(3.4, 2.6, 0.2, 1.9), _block(5.0, 2.0, 0.6, 0.6)),
    starts=np.array([[1.0, 1.0, 0.5], [1.0, 3.0, -0.5], [2.5, 2.0, 0.3]]),
)


def options_for(name, **more):
    unknown = {"known_starts": False} if "supervised" in name else {}
    if name == "oracle_starts":
        unknown = {"known_starts": False, "reveals_starts": True}
    return {
        "robots": 3,
        "horizon_s": HORIZON_S,
        "starts": "fixed",
        "map_cells": 64,
        **unknown,
        **NEEDS.get(name, {}),
        **more,
    }


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
    env = lidarium.parallel_env(TWO_ROOMS, level=policy.level, **options_for(name))
    env.use_level(policy.level, policy.shares_map, policy.decision_period_s)
    poses = run(env, policy)
    at = {"level": "frontier"} if policy.level == "frontier" else {}  # gains are observed there only
    other = lidarium.parallel_env(TWO_ROOMS, **at, **options_for(name))
    lidarium.run_episode(lidarium.policy(name), other, seed=3)
    assert len(poses) > 5
    assert np.array_equal(poses[-1], other.world.poses)
    assert env.scorer.curve == other.scorer.curve
    assert env.scorer.ended_because == other.scorer.ended_because


class BesideLearner:
    """A policy that drives one robot beside a learner, which draws the actions of the others."""

    def __init__(self, name, agent, space, seed):
        self.policy, self._agent, self._space = lidarium.policy(name), agent, space
        self._space.seed(seed)

    def act(self, agents, observations):
        actions = self.policy.act(observations, agents=[self._agent]) if self._agent in agents else {}
        assert set(actions) <= {self._agent}
        return {**{agent: self._space.sample() for agent in agents}, **actions}


@pytest.mark.parametrize(("name", "level"), CARRIED)
def test_every_policy_drives_one_robot_beside_a_learner_at_every_level_alone_and_in_each_row_of_a_batch(name, level):
    options = options_for(name, robots=2, horizon_s=4.0, resolution=0.1, map_cells=32)
    driven = ("robot_0", "robot_1")
    batch = lidarium.vector_env(2, TWO_ROOMS, level=level, reports=True, **options)
    batch.reset(seed=5)
    drivers = [BesideLearner(name, driven[k], copy.deepcopy(batch.single_action_space), 5 + k) for k in range(2)]
    for episode, driver in enumerate(drivers):
        driver.policy.reset(batch.team(episode), seed=5 + episode)
    poses = []
    while not any(batch.batch.is_over):
        teams = [batch.team(episode) for episode in range(2)]
        batch.step([driver.act(team.agents, team.observations) for driver, team in zip(drivers, teams, strict=True)])
        poses.append(batch.engine.world.poses.copy())
    for episode, agent in enumerate(driven):
        env = lidarium.parallel_env(TWO_ROOMS, level=level, **options)
        driver = BesideLearner(name, agent, copy.deepcopy(env.action_space(agent)), 5 + episode)
        observations, _ = env.reset(seed=5 + episode)
        driver.policy.reset(env, seed=5 + episode)
        robot = env.possible_agents.index(agent)
        start, moved = env.world.poses[robot].copy(), 0.0
        for in_batch in poses:
            observations, *_ = env.step(driver.act(env.agents, observations))
            assert np.array_equal(env.world.poses, in_batch[2 * episode : 2 * episode + 2])
            # A robot that has turned may turn back.
            moved = max(moved, float(np.abs(env.world.poses[robot] - start).max()))
        assert moved > 0.1
        assert env.world.collisions[robot] == 0


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


@pytest.mark.parametrize("name", NAMES)
def test_every_policy_drives_an_episode_of_a_batch_as_it_drives_a_single_environment(name):
    options = options_for(name, robots=2, horizon_s=6.0, resolution=0.1, map_cells=32)
    level = lidarium.policy(name).level
    batch = lidarium.vector_env(2, TWO_ROOMS, level=level, reports=True, **options)
    policies = [lidarium.policy(name) for _ in range(2)]
    batch.reset(seed=5)
    for episode, policy in enumerate(policies):
        policy.reset(batch.team(episode), seed=5 + episode)
    poses = []
    while not any(batch.batch.is_over):
        teams = [batch.team(episode) for episode in range(2)]
        batch.step([policy.act(team.observations) for policy, team in zip(policies, teams, strict=True)])
        poses.append(batch.engine.world.poses.copy())
    assert len(poses) >= 3
    for episode in range(2):
        env = lidarium.parallel_env(TWO_ROOMS, level=level, **options)
        alone = run(env, lidarium.policy(name), seed=5 + episode)
        rows = slice(2 * episode, 2 * episode + 2)
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
