"""Batches whose episodes draw settings: each is the randomized team with the same seed."""

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
    return lidarium.vector_env(episodes, "scene_room", randomize=NOISE, **{**SMALL, **options})


@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_each_episode_is_the_team_with_the_same_seed(level):
    rows = make(2, level=level)
    teams = [lidarium.parallel_env("scene_room", randomize=NOISE, level=level, **SMALL) for _ in range(2)]
    seen, _ = rows.reset(seed=5)
    alone = [team.reset(seed=5 + k)[0] for k, team in enumerate(teams)]
    generator = np.random.default_rng(1)
    resets = 0
    for _ in range(26):
        for k, observations in enumerate(alone):
            for robot, observation in enumerate(observations.values()):
                for name, value in observation.items():
                    assert np.array_equal(seen[name][2 * k + robot], value), name
        assert [team.drawn for team in teams] == rows.batch.drawn
        actions = (
            np.zeros(4, np.int64) if level == "frontier" else generator.uniform(-1.0, 1.0, (4, 2)).astype(np.float32)
        )
        seen, rewards, terminated, truncated, infos = rows.step(actions)
        for k, team in enumerate(teams):
            own = slice(2 * k, 2 * k + 2)
            if not team.agents:
                alone[k] = team.reset()[0]
                resets += 1
                assert not rewards[own].any()
                continue
            chosen = {agent: actions[2 * k + robot] for robot, agent in enumerate(team.possible_agents)}
            alone[k], wanted, ended, cut, _ = team.step(chosen)
            assert rewards[own].tolist() == list(wanted.values())
            assert terminated[own].tolist() == list(ended.values())
            assert truncated[own].tolist() == list(cut.values())
        assert infos["active"].shape == (4,)
    assert resets >= 4
    assert len({str(drawn) for drawn in rows.batch.drawn}) == 2


def test_spaces_infos_and_states_are_those_of_a_plain_batch():
    rows, plain = (
        make(3, observation="flat", comm=2),
        lidarium.vector_env(3, "scene_room", observation="flat", comm=2, **SMALL),
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


def test_teams_of_drawn_sizes_have_rows_for_the_largest():
    options = {**SMALL, "observe": ["scan", "teammates"], "robots": 2, "randomize": {"robots": [3, 2]}}
    rows = lidarium.vector_env(3, "scene_room", level="waypoint", **options)
    alone = lidarium.parallel_env("scene_room", level="waypoint", **options)
    assert rows.num_envs == 9
    seen, infos = rows.reset(seed=4)
    wanted, _ = alone.reset(seed=4)
    assert rows.batch.drawn[0] == alone.drawn
    for row, observation in enumerate(wanted.values()):
        assert all(np.array_equal(seen[name][row], value) for name, value in observation.items())
    sizes = [drawn["robots"] for drawn in rows.batch.drawn]
    exists = np.concatenate([np.arange(3) < size for size in sizes])
    assert infos["active"].tolist() == exists.tolist()
    assert not seen["scan"][~exists].any()
    ends = np.zeros(9, bool)
    for _ in range(12):
        seen, rewards, terminated, truncated, infos = rows.step(np.full((9, 2), 0.2, np.float32))
        assert not rewards[~exists].any()
        assert rows.observation_space.contains(seen)
        ends |= terminated | truncated
        if ends.all():
            break
    assert ends.all()


def test_learners_get_episodes_of_drawn_settings():
    pytest.importorskip("stable_baselines3")
    rows = lidarium.sb3_vec_env(2, "scene_room", randomize=NOISE, **SMALL)
    rows.seed(5)
    seen = rows.reset()
    plain, _ = make(2).reset(seed=5)
    assert all(np.array_equal(seen[name], plain[name]) for name in plain)
    dones = np.zeros(4, bool)
    for _ in range(12):
        _, _, done, _ = rows.step(np.full((4, 2), 0.2, np.float32))
        dones |= done
    assert dones.all()
    rows.close()


def test_what_cannot_be_drawn_in_batches_is_refused():
    rows = lidarium.vector_env(2, "scene_room", randomize={"map_cells": [32, 64]}, **{**SMALL, "observe": ["map"]})
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
