"""What a team returns in the forms that a trainer wants."""

import math

import numpy as np
import pytest
from conventional_teams import AHEAD, CLOSET, make, step

import lidarium


@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_the_flat_form_holds_the_numbers_of_the_dict_form(level):
    plain, flat = make(level=level), make(level=level, observation="flat")
    space = flat.observation_space("robot_0")
    wanted, own = plain.reset(seed=1)[0], flat.reset(seed=1)[0]
    for _ in range(3):
        for agent, vector in own.items():
            assert space.contains(vector)
            for name, first, last in flat.columns(agent):
                assert np.array_equal(vector[first:last], wanted[agent][name].ravel().astype(np.float32))
            assert flat.columns(agent)[-1][2] == len(vector)
        action = 0 if level == "frontier" else AHEAD
        wanted, own = step(plain, action)[0], step(flat, action)[0]


@pytest.mark.parametrize("form", ["dict", "flat"])
@pytest.mark.parametrize("infos", ["full", "flat", "none"])
def test_the_mask_may_be_in_infos_of_any_form(form, infos):
    env = make(level="frontier", observation=form, action_mask="infos", infos=infos)
    inside = make(level="frontier")
    observations, told = env.reset(seed=1)
    wanted = inside.reset(seed=1)[0]
    for _ in range(3):
        for agent, observation in observations.items():
            assert env.observation_space(agent).contains(observation)
            assert "action_mask" not in (observation if form == "dict" else ())
            assert np.array_equal(told[agent]["action_mask"], wanted[agent]["action_mask"])
            rest = {name: value for name, value in told[agent].items() if name != "action_mask"}
            assert infos == "full" or all(type(value) is float for value in rest.values())
            assert (infos == "none") == (not rest)
        observations, *_, told = step(env, 0)
        wanted = step(inside, 0)[0]


@pytest.mark.parametrize("infos", ["full", "flat", "none"])
def test_agents_that_have_ended_may_only_stay(infos):
    env = make(level="frontier", action_mask="infos", infos=infos, ended_agents="zeros")
    env.reset(seed=0)
    env.stop("robot_1", "enough")
    step(env, 0)
    assert env.agents == ["robot_0", "robot_1"]
    told = step(env, 0)[-1]
    assert told["robot_1"]["action_mask"].tolist() == [0] * 32 + [1]


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
def test_flat_infos_are_numbers_under_the_same_names(level):
    env, full = (
        make(CLOSET, level=level, infos="flat", horizon_s=8.0),
        make(CLOSET, level=level, horizon_s=8.0),
    )
    infos, wanted = env.reset(seed=1)[1], full.reset(seed=1)[1]
    names = set(infos["robot_0"])
    while True:
        for agent, info in infos.items():
            assert set(info) == names
            assert all(type(value) is float for value in info.values())
            assert info["truth.coverage"] == wanted[agent]["truth"]["coverage"]
            assert info["truth.pose.2"] == wanted[agent]["truth"]["pose"][2]
            assert info["reward_terms.area"] == wanted[agent]["reward_terms"]["area"]
            assert (info["ended"] > 0) == ("ended_because" in wanted[agent])
        if not env.agents:
            break
        action = 32 if level == "frontier" else AHEAD
        infos, wanted = step(env, action)[4], step(full, action)[4]


def test_agents_that_stay_end_as_terminated_where_the_horizon_cuts_the_others():
    env = make(ended_agents="zeros", horizon_s=0.5)
    env.reset(seed=0)
    env.unwrapped.stop("robot_1", "enough")
    while env.agents:
        outcome = step(env)
    assert outcome[2] == {"robot_0": False, "robot_1": True}
    assert outcome[3] == {"robot_0": True, "robot_1": False}
    env.reset(seed=1)
    assert env.agents == ["robot_0", "robot_1"]


@pytest.mark.parametrize("share", [0.25, 1.0])
def test_a_share_of_the_reward_is_the_mean_of_the_team(share):
    env, own = make(team_reward=share), make()
    env.reset(seed=0)
    own.reset(seed=0)
    for _ in range(5):
        _, rewards, _, _, infos = step(env)
        alone = step(own)[1]
        mean = sum(alone.values()) / 2
        for agent, reward in rewards.items():
            assert reward == pytest.approx((1 - share) * alone[agent] + share * mean)
            assert math.fsum(infos[agent]["reward_terms"].values()) == pytest.approx(reward)


@pytest.mark.parametrize("place", ["inside", "beside", "infos"])
@pytest.mark.parametrize("form", ["dict", "flat"])
def test_the_mask_of_an_ended_robot_allows_to_stay_in_every_form(place, form):
    env = lidarium.parallel_env(
        "scene_room",
        robots=2,
        level="frontier",
        frontiers=4,
        observe=["time_left"],
        observation=form,
        action_mask=place,
        ended_agents="zeros",
        starts="fixed",
    )
    env.reset(seed=0)
    env.stop("robot_0", "enough")
    env.step(dict.fromkeys(env.agents, 4))
    observations, *_, infos = env.step(dict.fromkeys(env.agents, 4))
    assert env.action_masks("robot_0").tolist() == [False] * 4 + [True]
    assert env.action_masks("robot_1").any()
    seen = infos["robot_0"] if place == "infos" else observations["robot_0"]
    if (place, form) == ("inside", "flat"):
        ((first, last),) = (rest for name, *rest in env.columns("robot_0") if name == "action_mask")
        seen = {"action_mask": seen[first:last]}
    assert seen["action_mask"].tolist() == [0, 0, 0, 0, 1]


def test_a_robot_that_has_left_may_only_stay():
    env = lidarium.parallel_env("scene_room", robots=2, level="frontier", frontiers=4, starts="fixed")
    env.reset(seed=0)
    env.stop("robot_0", "enough")
    env.step(dict.fromkeys(env.agents, 4))
    assert env.action_masks("robot_0").tolist() == [False] * 4 + [True]
