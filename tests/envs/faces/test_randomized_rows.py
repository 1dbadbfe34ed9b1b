"""Batches whose episodes draw settings: each is the randomized team with the same seed."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import lidarium

SMALL = {
    "robots": 2,
    "map_cells": 32,
    "lidar": "lidar_360_6m",
    "horizon_s": 1.0,
    "stop_coverage": None,
    "observe": ["scan", "velocity"],
}
NOISE = {"lidar.noise_floor": (0.0, 0.05), "reward.time": (0.0, 1.0)}


def make(episodes, **options):
    return lidarium.vector_env(episodes, "scene_room", randomize=NOISE, **{"starts": "fixed", **SMALL, **options})


def test_spaces_infos_and_states_are_those_of_a_plain_batch():
    rows, plain = (
        make(3, observation="flat", comm=2),
        lidarium.vector_env(3, "scene_room", observation="flat", comm=2, **SMALL, starts="fixed"),
    )
    assert rows.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    assert rows.observation_space == plain.observation_space
    assert rows.action_space == plain.action_space
    for env in (rows, plain):
        env.reset(seed=1)
    both = [env.step(np.full((6, 4), 0.3, np.float32)) for env in (rows, plain)]
    assert both[0][0].shape == both[1][0].shape
    assert both[0][4].keys() == both[1][4].keys()
    assert both[0][4]["truth"]["pose"].shape == (6, 3)
    assert rows.state().shape == plain.state().shape
    rows.close()


def test_options_and_curricula_reach_the_episodes():
    floors = ["apartment", "scene_room"]
    rows = make(2, curriculum=lambda number: {"floor": "apartment"} if number == 1 else {})
    rows.reset(seed=0)
    names = [part.engine.floors[0].name for part in rows.batch.parts]
    assert names == ["scene_room", "apartment"]
    rows.reset(seed=0, options={"floor": floors})
    assert [part.engine.floors[0].name for part in rows.batch.parts] == floors


def test_what_cannot_be_drawn_in_batches_is_refused():
    rows = lidarium.vector_env(
        2, "scene_room", randomize={"map_cells": [32, 64]}, **{**SMALL, "observe": ["map"]}, starts="fixed"
    )
    with pytest.raises(ValueError, match="want some that leave the spaces"):
        [rows.reset(seed=seed) for seed in range(10)]
    with pytest.raises(RuntimeError, match="was not reset"):
        make(2).step(np.zeros((4, 2)))
    rows = make(2)
    rows.reset(seed=0)
    with pytest.raises(ValueError, match="actions have shape"):
        rows.step(np.zeros((3, 2)))
    with pytest.raises(TypeError, match="unknown option 'horizon'"):
        make(2, horizon=3)
    with pytest.raises(ValueError, match="the number of episodes is 0; want"):
        make(0)


def test_a_bad_action_is_named_and_changes_nothing():
    rows = make(2)
    rows.reset(seed=1)
    actions = np.full((4, 2), 0.3, np.float32)
    actions[3] = np.nan
    before = [part.engine.world.steps.copy() for part in rows.batch.parts]
    with pytest.raises(ValueError, match=r"in episode 1, whose rows begin with 2: .*row 1"):
        rows.step(actions)
    by_agent = [{"robot_0": actions[row], "robot_1": actions[row + 1]} for row in (0, 2)]
    with pytest.raises(ValueError, match=r"in episode 1, whose rows begin with 2: .*robot_1"):
        rows.batch.step_teams(by_agent, np.empty(0, np.int64))
    for part, steps in zip(rows.batch.parts, before, strict=True):
        assert np.array_equal(part.engine.world.steps, steps)
    rows.close()


def test_robots_that_a_team_lacks_can_only_stay():
    envs = lidarium.vector_env(2, "scene_room", level="frontier", randomize={"robots": [1, 2]}, horizon_s=5.0)
    envs.reset(seed=0)
    masks = envs.batch.masks
    assert masks.any(axis=1).all()
    lacking = [part.robots == 1 for part in envs.batch.parts]
    for episode in np.flatnonzero(lacking):
        assert masks[2 * episode + 1].tolist() == [False] * (masks.shape[1] - 1) + [True]
    envs.close()


def test_a_robot_besides_kinds_is_refused():
    with pytest.raises(ValueError, match="robot is set, and kinds is"):
        lidarium.make_settings(kinds=["kobuki"], robot="pioneer")
    with pytest.raises(ValueError, match="robot is set, and kinds is"):
        lidarium.parallel_env("scene_room", kinds=["kobuki"], randomize={"robot.max_speed": [0.4]})


def test_a_reset_that_fails_begins_no_episode():
    env = lidarium.vector_env(2, "apartment", robots=1, randomize={"odometry.drift": (0.0, 0.1)}, lidar={"beams": 20})
    starts = [None, np.full((1, 3), 1e5)]
    with pytest.raises(ValueError, match="is inside a wall"):
        env.reset(seed=0, options={"starts": starts})
    with pytest.raises(RuntimeError, match="reset"):
        env.step(np.zeros((2, 2)))


@pytest.mark.parametrize("place", ["inside", "beside", "infos"])
@pytest.mark.parametrize("form", ["dict", "flat"])
def test_robots_that_a_team_lacks_may_only_stay(place, form):
    env = lidarium.vector_env(
        1,
        "scene_room",
        randomize={"robots": [1, 2]},
        **{**SMALL, "observe": ["time_left"], "starts": "fixed"},
        level="frontier",
        frontiers=4,
        observation=form,
        action_mask=place,
    )
    for seed in range(9):
        observations, infos = env.reset(seed=seed)
        if env.drawn[0]["robots"] == 1:
            break
    seen = infos if place == "infos" else observations
    if (place, form) == ("inside", "flat"):
        ((first, last),) = (rest for name, *rest in env.columns if name == "action_mask")
        seen = {"action_mask": observations[:, first:last]}
        assert env.batch.observation(1)[first:last].tolist() == [0, 0, 0, 0, 1]
    assert seen["action_mask"][1].tolist() == [0, 0, 0, 0, 1]
    assert env.batch.masks[1].tolist() == [False] * 4 + [True]
    assert infos["active"].tolist() == [True, False]


def test_faces_have_the_drawn_values():
    options = {**SMALL, "randomize": NOISE}
    batch, names = make(2), [set(NOISE)] * 2
    batch.reset(seed=0)
    assert list(map(set, batch.drawn)) == names
    team = lidarium.parallel_env("scene_room", **options)
    team.reset(seed=1)
    assert batch.drawn[1] == team.drawn
    solo = gymnasium.make("lidarium/Exploration-v1", floor="scene_room", **{**options, "robots": 1}).unwrapped
    solo.reset(seed=1)
    assert set(solo.drawn) == set(NOISE)
    assert lidarium.vector_env(2, "scene_room", **SMALL).drawn == [{}, {}]
    pytest.importorskip("stable_baselines3")
    assert list(map(set, lidarium.sb3_vec_env(2, "scene_room", **options).drawn)) == names
