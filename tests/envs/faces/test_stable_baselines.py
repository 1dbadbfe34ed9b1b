"""The rows for stable-baselines3: resets in the step that ends, terminal observations, truncation, masks,
and training."""

import math

import gymnasium
import numpy as np
import pytest

import lidarium
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.settings.lidar import Lidar

stable_baselines3 = pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed: extra [rl]")
sb3_contrib = pytest.importorskip("sb3_contrib", reason="sb3-contrib is not installed: extra [rl]")

import torch  # noqa: E402
from sb3_contrib.common.maskable.utils import get_action_masks, is_masking_supported  # noqa: E402
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize  # noqa: E402

ROOM = Floor("room", (0.0, 0.0, 5.0, 4.0), (Solid(np.array([(2.4, 0.0), (2.6, 0.0), (2.6, 2.8), (2.4, 2.8)])),))
FEW = {
    "lidar": Lidar(beams=36, field_of_view=2.0 * math.pi, range_max=6.0),
    "observe": ["scan", "pose"],
    "robots": 1,
    "threads": 1,
    "horizon_s": 2.0,
}
AHEAD, STAY = (1.0, 0.0), (0.0, 0.0)
IDS = ("Exploration", "WaypointExploration", "FrontierExploration")


@pytest.fixture(autouse=True)
def one_thread():
    """Small networks learn fastest on one thread."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def assert_row(observations, row, wanted):
    for name, value in wanted.items():
        assert np.array_equal(observations[name][row], value), name


def test_the_terminal_observation_is_the_last_of_the_episode_that_ended():
    envs = lidarium.sb3_vec_env(2, ROOM, **{**FEW, "horizon_s": 1.0, "stop_coverage": None}, starts="fixed")
    alone = lidarium.parallel_env(ROOM, **{**FEW, "horizon_s": 1.0, "stop_coverage": None}, starts="fixed")
    envs.seed(4)
    envs.reset()
    alone.reset(seed=5)
    for _ in range(10):
        observations, _, dones, infos = envs.step(np.tile(AHEAD, (2, 1)))
        last = alone.step({"robot_0": AHEAD})[0]["robot_0"]
    assert dones.all()
    assert set(infos[1]["terminal_observation"]) == {"scan", "pose"}
    assert_row({name: value[None] for name, value in infos[1]["terminal_observation"].items()}, 0, last)
    assert_row(observations, 1, alone.reset()[0]["robot_0"])
    assert not np.array_equal(observations["pose"][1], last["pose"])
    assert np.array_equal(envs.reset_infos[1]["truth"]["pose"], alone.world.poses[0])
    kept = {name: value.copy() for name, value in infos[1]["terminal_observation"].items()}
    for _ in range(3):
        envs.step(np.tile(AHEAD, (2, 1)))
    assert_row({name: value[None] for name, value in kept.items()}, 0, infos[1]["terminal_observation"])


def test_the_horizon_truncates_and_an_ending_does_not():
    covered = lidarium.sb3_vec_env(1, ROOM, **{**FEW, "stop_coverage": 0.01}, starts="fixed")
    covered.reset()
    _, _, dones, infos = covered.step(np.zeros((1, 2)))
    assert dones[0]
    assert (infos[0]["ended_because"], infos[0]["TimeLimit.truncated"]) == ("covered", False)
    cut = lidarium.sb3_vec_env(1, ROOM, **{**FEW, "horizon_s": 0.2, "stop_coverage": None}, starts="fixed")
    cut.reset()
    _, _, dones, infos = cut.step(np.zeros((1, 2)))
    assert (dones[0], infos[0]["TimeLimit.truncated"], "terminal_observation" in infos[0]) == (
        False,
        False,
        False,
    )
    _, _, dones, infos = cut.step(np.zeros((1, 2)))
    assert dones[0]
    assert (infos[0]["ended_because"], infos[0]["TimeLimit.truncated"]) == ("horizon", True)


def test_a_robot_that_ends_early_is_done_and_then_masked_until_its_episode_begins_anew():
    envs = lidarium.sb3_vec_env(
        1,
        ROOM,
        **{**FEW, "robots": 2, "stop_on_contact": True, "horizon_s": 3.0, "stop_coverage": None},
        starts="fixed",
    )
    envs.set_options({"starts": [(4.2, 3.0, 0.0), (1.0, 1.0, math.pi / 2)]})
    envs.reset()
    steps = []
    for _ in range(31):
        observations, rewards, dones, infos = envs.step(np.array([AHEAD, STAY]))
        steps.append(({name: array.copy() for name, array in observations.items()}, rewards, dones, infos))
    end = next(k for k, step in enumerate(steps) if step[2][0])
    observations, rewards, dones, infos = steps[end]
    assert (infos[0]["ended_because"], infos[0]["TimeLimit.truncated"], infos[0]["active"]) == (
        "collision",
        False,
        True,
    )
    assert rewards[0] != 0.0
    assert_row(observations, 0, infos[0]["terminal_observation"])
    last = infos[0]["terminal_observation"]
    for observations, rewards, dones, infos in steps[end + 1 : 29]:
        assert_row(observations, 0, last)
        assert (rewards[0], infos[0]["active"], infos[1]["active"], list(dones)) == (
            0.0,
            False,
            True,
            [False, False],
        )
        assert "terminal_observation" not in infos[0]
    observations, rewards, dones, infos = steps[29]
    assert list(dones) == [True, True]
    assert [info["TimeLimit.truncated"] for info in infos] == [True, True]
    assert [info["active"] for info in infos] == [False, True]
    assert "ended_because" not in infos[0]
    assert_row({name: value[None] for name, value in infos[0]["terminal_observation"].items()}, 0, last)
    assert not np.array_equal(observations["scan"][0], last["scan"])
    assert all(info["active"] for info in steps[30][3])


def test_seeds_count_by_episode_and_hold_for_one_reset():
    envs = lidarium.sb3_vec_env(3, ROOM, **{**FEW, "robots": 2}, starts="fixed")
    assert envs.seed(8) == [8, 8, 9, 9, 10, 10]
    poses = envs.reset()["pose"].copy(), envs.reset()["pose"].copy()
    wanted, _ = (oracle := lidarium.vector_env(3, ROOM, **{**FEW, "robots": 2}, starts="fixed")).reset(seed=8)
    assert np.array_equal(poses[0], wanted["pose"])
    assert np.array_equal(poses[1], oracle.reset()[0]["pose"])
    assert len(set(envs.seed())) == 3
    with pytest.raises(ValueError, match="seed is -1; want a whole number"):
        envs.seed(-1)


def test_options_are_for_all_episodes_for_each_or_for_each_row():
    envs = lidarium.sb3_vec_env(2, ROOM, **{**FEW, "robots": 2}, starts="fixed")
    envs.set_options({"floor": ["clinic", "apartment"]})
    envs.reset()
    assert [floor.name for floor in envs.engine.floors] == ["clinic", "apartment"]
    envs.set_options([{"floor": "apartment"}, {}, {"floor": ROOM}, {}])
    envs.reset()
    assert [floor.name for floor in envs.engine.floors] == ["apartment", "room"]
    envs.reset()
    assert [floor.name for floor in envs.engine.floors] == ["room", "room"]
    with pytest.raises(ValueError, match="options has 2 entries; want one dict, or one for each of the 4 rows"):
        envs.set_options([{}, {}])
    with pytest.raises(ValueError, match=r"option starts has shape \(1, 3\); want \(2, 3\)"):
        envs.set_options({"starts": [(1.0, 1.0, 0.0)]})


def test_attributes_are_shared_and_rows_have_no_methods_of_their_own():
    envs = lidarium.sb3_vec_env(2, ROOM, **{**FEW, "robots": 2}, starts="fixed")
    assert envs.num_envs == 4
    assert envs.get_attr("settings", [0, 3]) == [envs.settings] * 2
    assert envs.get_attr("render_mode") == [None] * 4
    assert envs.env_is_wrapped(gymnasium.Wrapper, 1) == [False]
    assert envs.get_images() == [None] * 4
    assert envs.has_attr("settings")
    assert not envs.has_attr("colour")
    with pytest.raises(AttributeError, match="cannot be set for single rows"):
        envs.set_attr("settings", None)
    with pytest.raises(AttributeError, match="cannot be called on single rows"):
        envs.env_method("render")


def test_steps_out_of_turn_say_what_to_do():
    envs = lidarium.sb3_vec_env(2, ROOM, **FEW, starts="fixed")
    with pytest.raises(RuntimeError, match="not reset; call reset"):
        envs.step(np.zeros((2, 2)))
    envs.reset()
    with pytest.raises(RuntimeError, match="call step_async"):
        envs.step_wait()
    envs.step_async(np.zeros((2, 2)))
    envs.reset()
    with pytest.raises(RuntimeError, match="call step_async"):
        envs.step_wait()
    with pytest.raises(ValueError, match="nan or infinite"):
        envs.step(np.full((2, 2), np.nan))
    envs.close()
    for use in (envs.reset, lambda: envs.step(np.zeros((2, 2)))):
        with pytest.raises(RuntimeError, match="closed; make a new one"):
            use()
    with pytest.raises(ValueError, match="number of episodes is 0"):
        lidarium.sb3_vec_env(0)


def test_the_level_of_frontiers_has_masks_of_actions():
    envs = lidarium.sb3_vec_env(2, ROOM, level="frontier", **FEW, starts="fixed")
    observations = envs.reset()
    assert is_masking_supported(envs)
    assert get_action_masks(envs).dtype == np.bool_
    assert np.array_equal(get_action_masks(envs), observations["action_mask"] == 1)
    assert np.array_equal(envs.env_method("action_masks", indices=1)[0], observations["action_mask"][1] == 1)
    for level in ("velocity", "waypoint"):
        assert not is_masking_supported(lidarium.sb3_vec_env(1, ROOM, level=level, **FEW, starts="fixed"))


PPO_FEW = {"n_steps": 250, "batch_size": 250, "n_epochs": 2}
SAC_FEW = {"learning_starts": 100, "batch_size": 32, "train_freq": 20, "gradient_steps": 2}


def assert_trains(algorithm, env, steps=500, **options):
    model = algorithm("MultiInputPolicy", env, seed=0, policy_kwargs={"net_arch": [32]}, **options)
    model.learn(steps)
    assert model.num_timesteps >= steps
    assert all(torch.isfinite(parameter).all() for parameter in model.policy.parameters())
    assert len(model.ep_info_buffer) > 0


@pytest.mark.parametrize(("algorithm", "options"), [("PPO", PPO_FEW), ("SAC", SAC_FEW)])
@pytest.mark.parametrize("is_batch", [True, False])
def test_stable_baselines_algorithms_train(algorithm, options, is_batch):
    env = (
        VecMonitor(lidarium.sb3_vec_env(4, ROOM, **FEW, starts="fixed"))
        if is_batch
        else gymnasium.make("lidarium/Exploration-v1", floor=ROOM, **FEW)
    )
    assert_trains(getattr(stable_baselines3, algorithm), env, **options)


def test_teams_train_on_an_egocentric_map_and_normalised_rewards():
    options = {
        **FEW,
        "robots": 2,
        "observe": ["velocity", "egocentric_map"],
        "egocentric_cells": 36,
        "stop_on_contact": True,
    }
    env = VecNormalize(VecMonitor(lidarium.sb3_vec_env(2, ROOM, **{"starts": "fixed", **options})), norm_obs=False)
    assert_trains(stable_baselines3.PPO, env, 256, n_steps=64, batch_size=128, n_epochs=1)


def test_maskable_ppo_trains_on_frontiers():
    env = VecMonitor(lidarium.sb3_vec_env(4, ROOM, level="frontier", **{**FEW, "horizon_s": 20.0}, starts="fixed"))
    assert_trains(sb3_contrib.MaskablePPO, env, **PPO_FEW)


def test_rows_take_orders_and_the_actions_of_each_team_by_agent():
    options = {**FEW, "robots": 2, "horizon_s": 20.0}
    rows = lidarium.sb3_vec_env(2, ROOM, level="waypoint", **options)
    batch = lidarium.vector_env(2, ROOM, level="waypoint", **options)
    rows.seed(0)
    rows.reset()
    batch.reset(seed=0)
    assert rows.state_space == batch.state_space
    assert rows.columns == batch.columns
    target = lidarium.Target(0.5, 0.5)
    for env in (rows, batch):
        env.team(0).order("robot_0", lidarium.Order("pause"))
    actions = [{"robot_1": target}, {"robot_0": lidarium.Stop("enough"), "robot_1": None}]
    observations, rewards, dones, infos = rows.step(actions)
    wanted = batch.step(actions)
    for name, array in observations.items():
        np.testing.assert_array_equal(array, wanted[0][name])
    np.testing.assert_array_equal(rewards, wanted[1].astype(np.float32))
    assert dones.tolist() == [False, False, True, False]
    assert infos[0]["state"] == "paused"
    assert infos[2]["ended_because"] == "enough"
