"""Settings that are drawn for each episode."""

import pickle

import gymnasium
import numpy as np
import pytest

import lidarium

SMALL = {"robots": 2, "map_cells": 32, "lidar": "lidar_360_6m"}
NOISE = {"lidar.noise_floor": (0.0, 0.05), "decision_period_s": [1.0, 2.0], "reward.time": (1, 3)}


def settings_of(env):
    return env.settings.lidar.noise_floor, env.settings.decision_period_s, env.settings.reward.time


def test_each_episode_has_settings_of_its_own():
    env = lidarium.parallel_env("scene_room", level="waypoint", randomize=NOISE, **SMALL, starts="fixed")
    drawn = set()
    for _ in range(12):
        env.reset()
        noise, period, price = settings_of(env)
        assert env.unwrapped.settings is env.settings
        assert env.drawn == {
            "lidar.noise_floor": noise,
            "decision_period_s": period,
            "reward.time": price,
        }
        assert 0.0 <= noise <= 0.05
        assert period in (1.0, 2.0)
        assert 1.0 <= price <= 3.0
        drawn.add((noise, period, price))
    assert len(drawn) == 12
    assert len({period for _, period, _ in drawn}) == 2


def test_a_seed_gives_the_same_settings_and_the_same_episode():
    def run(env):
        observations, _ = env.reset(seed=4)
        seen = [observations["robot_0"]["scan"].copy(), settings_of(env)]
        observations, _ = env.reset()
        return [*seen, observations["robot_0"]["scan"].copy(), settings_of(env)]

    first, again = (
        run(lidarium.parallel_env("scene_room", randomize=NOISE, **SMALL, starts="fixed")) for _ in range(2)
    )
    assert all(np.array_equal(one, other) for one, other in zip(first, again, strict=True))
    assert first[1] != first[3]


def test_an_episode_is_that_of_an_environment_with_these_settings():
    env = lidarium.parallel_env("scene_room", randomize={"lidar.noise_floor": (0.01, 0.05)}, **SMALL, starts="fixed")
    observations, _ = env.reset(seed=2)
    plain = lidarium.parallel_env("scene_room", settings=env.settings, starts="fixed")
    wanted, _ = plain.reset(seed=2)
    for _ in range(5):
        for agent, observation in wanted.items():
            assert all(np.array_equal(observations[agent][name], value) for name, value in observation.items())
        actions = dict.fromkeys(env.agents, np.array([0.5, 0.1], np.float32))
        observations, wanted = env.step(actions)[0], plain.step(actions)[0]


def test_conventions_curricula_and_gymnasium_go_with_it():
    env = lidarium.parallel_env(
        "scene_room",
        randomize={"reward.time": (0.0, 1.0)},
        curriculum=lambda number: {"floor": "apartment" if number else "scene_room"},
        observation="flat",
        infos="flat",
        **SMALL,
        starts="fixed",
    )
    names = []
    for _ in range(3):
        observations, _ = env.reset()
        assert env.observation_space("robot_0").contains(observations["robot_0"])
        names.append(env.unwrapped.floor.name)
    assert names == ["scene_room", "apartment", "apartment"]
    solo = gymnasium.make(
        "lidarium/FrontierExploration-v1", floor="scene_room", randomize={"reward.time": [0.5]}
    ).unwrapped
    solo.reset(seed=0)
    assert solo.action_masks().any()
    assert solo.parallel.settings.reward.time == 0.5


def test_a_copy_goes_on_as_the_original():
    env = lidarium.parallel_env("scene_room", randomize=NOISE, **SMALL, starts="fixed")
    env.reset(seed=1)
    copied = pickle.loads(pickle.dumps(env))
    scans = [each.reset()[0]["robot_0"]["scan"] for each in (env, copied)]
    assert np.array_equal(*scans)


@pytest.mark.parametrize(
    ("randomize", "words"),
    [
        ({}, "randomize is {}; want a dict from names of settings to distributions"),
        ([("a", 1)], "randomize is"),
        ({"reward.time": 3}, "the distribution of reward.time is 3; want"),
        ({"reward.time": (2.0, 1.0)}, "the distribution of reward.time is"),
        ({"reward.time": (0.0, float("inf"))}, "the distribution of reward.time is"),
        ({"reward.time": []}, "the distribution of reward.time is"),
        ({"reward.tim": (0.0, 1.0)}, "'reward.tim' is no setting"),
        ({"time_step": [-1.0]}, "time_step is -1.0"),
        ({"robots": (0, 3)}, r"the distribution of robots is \(0, 3\); want"),
        ({"robots": (1.0, 4.0)}, "the distribution of robots is"),
        ({"robots": [True]}, "the distribution of robots is"),
        ({"robots": [1, 2.5]}, "the distribution of robots is"),
        ({"robots": lambda generator: 2}, "so that the largest team is known"),
    ],
)
def test_what_is_no_distribution_of_a_setting_is_refused(randomize, words):
    with pytest.raises(ValueError, match=words):
        lidarium.parallel_env("scene_room", randomize=randomize, **SMALL)


def test_draws_that_change_the_spaces_are_refused():
    env = lidarium.parallel_env("scene_room", randomize={"map_cells": [32, 64]}, **SMALL, starts="fixed")
    with pytest.raises(ValueError, match="want some that leave the spaces of observations and actions"):
        [env.reset(seed=seed) for seed in range(20)]


def test_the_size_of_the_team_is_drawn_for_each_episode():
    options = {**SMALL, "observe": ["bumper", "teammates"], "horizon_s": 3.0}
    env = lidarium.parallel_env("scene_room", randomize={"robots": (2, 4)}, **{"starts": "fixed", **options})
    assert env.possible_agents == ["robot_0", "robot_1", "robot_2", "robot_3"]
    sizes = set()
    for seed in range(8):
        observations, infos = env.reset(seed=seed)
        size = env.settings.robots
        sizes.add(size)
        assert list(observations) == list(infos) == env.agents == env.possible_agents[:size]
        for agent, observation in observations.items():
            assert env.observation_space(agent).contains(observation)
            assert not observation["teammates"][size - 1 :].any()
        plain = lidarium.parallel_env("scene_room", **{**options, "robots": size}, starts="fixed")
        wanted, _ = plain.reset(seed=seed)
        assert np.array_equal(observations["robot_0"]["teammates"][: size - 1], wanted["robot_0"]["teammates"])
        state, plain_state = env.state(), plain.state()
        assert env.state_space.contains(state)
        assert np.array_equal(state[: 7 * size], plain_state[: 7 * size])
        assert np.array_equal(state[28:], plain_state[7 * size :])
        assert not state[7 * size : 28].any()
    assert sizes == {2, 3, 4}


def test_flat_observations_of_teammates_want_teams_of_one_size():
    env = lidarium.parallel_env(
        "scene_room",
        randomize={"robots": [2, 3]},
        observation="flat",
        observe=["bumper", "teammates"],
        **SMALL,
        starts="fixed",
    )
    with pytest.raises(ValueError, match="want some that leave the spaces"):
        [env.reset(seed=seed) for seed in range(20)]


def test_between_whole_numbers_a_setting_that_is_no_whole_number_is_drawn_from_all():
    env = lidarium.parallel_env(
        "apartment", randomize={"odometry.drift": (0, 1), "robots": (1, 3)}, lidar={"beams": 20}
    )
    drawn = []
    for seed in range(8):
        env.reset(seed=seed)
        drawn.append(env.drawn["odometry.drift"])
        assert isinstance(env.drawn["robots"], int)
    assert all(0.0 < each < 1.0 for each in drawn)


def test_a_team_that_is_too_small_is_refused_before_it_is_drawn():
    with pytest.raises(ValueError, match="teams of 1 to 3 robots are drawn: comm is 2 and robots is 1"):
        lidarium.parallel_env("apartment", randomize={"robots": (1, 3)}, comm=2)
    with pytest.raises(ValueError, match="teams of one robot are drawn; want two robots or more"):
        lidarium.MergedMaps(lidarium.parallel_env("apartment", randomize={"robots": (1, 3)}, known_starts=False))


def test_a_reset_that_fails_leaves_the_episode_as_it_is():
    env, same = (
        lidarium.parallel_env("apartment", robots=1, randomize={"odometry.drift": (0.0, 0.1)}, lidar={"beams": 20})
        for _ in range(2)
    )
    for each in (env, same):
        each.reset(seed=1)
    with pytest.raises(ValueError, match="is inside a wall"):
        env.reset(options={"starts": np.full((1, 3), 1e5)})
    env.step({"robot_0": np.zeros(2, np.float32)})
    for each in (env, same):
        each.reset()
    assert env.drawn == same.drawn


def test_it_has_the_face_of_an_environment():
    env = lidarium.parallel_env("apartment", randomize={"robots": (1, 2)}, lidar={"beams": 20})
    env.reset(seed=0)
    assert env.time_s == 0.0
    env.use_level("frontier")
    env.reset(seed=0)
    assert env.action_masks("robot_0").shape == (env.action_space("robot_0").n,)
    assert env.belief("robot_0").pose.shape == (3,)
    env.step(dict.fromkeys(env.agents, 0))
    env.close()
    with pytest.raises(RuntimeError, match="closed"):
        env.reset(seed=0)
