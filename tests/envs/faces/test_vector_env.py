"""The rows as one Gymnasium vector environment: spaces, resets, masks, seeds, options, copies, and what is
refused."""

import copy
import dataclasses
import math
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import DictInfoToList, RecordEpisodeStatistics

import lidarium
from lidarium.envs.faces.vector_env import ExplorationVectorEnv
from lidarium.envs.floors.catalogue import names as catalogue
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.envs.settings.lidar import Lidar
from lidarium.envs.settings.making import make_settings
from lidarium.mapping.grids.scan_geometry import MAX_BEAMS
from lidarium.mapping.kernels.compilation import available_threads

ROOM = Floor("room", (0.0, 0.0, 5.0, 4.0), (Solid(np.array([(2.4, 0.0), (2.6, 0.0), (2.6, 2.8), (2.4, 2.8)])),))
COARSE = Lidar(beams=36, field_of_view=2.0 * math.pi, range_max=6.0)
FEW = {"lidar": COARSE, "observe": ["scan", "pose"], "robots": 1, "threads": 1}
IDS = {"velocity": "Exploration", "waypoint": "WaypointExploration", "frontier": "FrontierExploration"}
AHEAD, STAY = (1.0, 0.0), (0.0, 0.0)

TOLD_ALWAYS = {prefix + name for name in ("truth", "state", "order", "active", "reward_terms") for prefix in ("", "_")}
"""Keys of infos when nothing special has happened."""


def assert_same(one, other):
    assert set(one) == set(other)
    for name, array in one.items():
        assert array.dtype == other[name].dtype, name
        assert np.array_equal(array, other[name]), name


def without_masks(infos):
    return {name: value for name, value in infos.items() if not name.startswith("_") and name != "active"}


@pytest.mark.parametrize("level", IDS)
def test_one_robot_an_episode_is_as_in_gymnasiums_own_vector_environment(level):
    options = {
        "floor": ROOM,
        "horizon_s": 1.5,
        "decision_period_s": 0.3,
        "lidar": COARSE,
        "map_cells": 32,
        "threads": 1,
    }
    batch = gymnasium.make_vec(f"lidarium/{IDS[level]}-v1", 3, **options)
    oracle = gymnasium.make_vec(f"lidarium/{IDS[level]}-v1", 3, vectorization_mode="sync", **options)
    assert isinstance(batch, ExplorationVectorEnv)
    assert batch.spec.id == oracle.spec.id
    assert batch.metadata["autoreset_mode"] is oracle.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    for name in (
        "observation_space",
        "single_observation_space",
        "action_space",
        "single_action_space",
        "num_envs",
        "render_mode",
    ):
        assert getattr(batch, name) == getattr(oracle, name)
    batch.action_space.seed(3)
    told, wanted = batch.reset(seed=7), oracle.reset(seed=7)
    resets = np.zeros(3, np.int64)
    for _ in range(40):
        assert_same(told[0], wanted[0])
        assert batch.observation_space.contains(told[0])
        for part, wanted_part in zip(told[1:-1], wanted[1:-1], strict=True):
            assert part.dtype == wanted_part.dtype
            assert np.array_equal(part, wanted_part)
        infos, wanted_infos = without_masks(told[-1]), without_masks(wanted[-1])
        for nested in ("truth", "reward_terms"):
            assert_same(infos.pop(nested), without_masks(wanted_infos.pop(nested)))
        assert set(infos) == set(wanted_infos)
        for name, array in infos.items():
            assert np.array_equal(told[-1][f"_{name}"], wanted[-1][f"_{name}"])
            assert all(one == other for one, other in zip(array, wanted_infos[name], strict=True)), name
        assert told[-1]["active"].all()
        if len(told) == 5:
            resets += told[2] | told[3]
        actions = batch.action_space.sample()
        told, wanted = batch.step(actions), oracle.step(actions)
    assert (resets >= 2).all()
    batch.close()
    oracle.close()


def test_later_episodes_draw_from_the_generator_of_their_episode():
    batch = lidarium.vector_env(2, ROOM, horizon_s=0.2, **FEW, starts="fixed")
    alone = lidarium.parallel_env(ROOM, horizon_s=0.2, **FEW, starts="fixed")
    firsts = [batch.reset(seed=20)[0]["pose"][1]]
    wanted = [alone.reset(seed=21)[0]["robot_0"]["pose"]]
    for _ in range(3):
        for _ in range(3):
            observations = batch.step(np.zeros((2, 2)))[0]
        firsts.append(observations["pose"][1])
        wanted.append(alone.reset()[0]["robot_0"]["pose"])
    assert np.array_equal(firsts, wanted)
    assert len(np.unique(firsts, axis=0)) == 4


def masked_run():
    """A robot that runs into the wall ahead of it beside one that stands still, until the horizon and a
    step beyond."""
    options = {**FEW, "robots": 2, "stop_on_contact": True, "horizon_s": 3.0, "stop_coverage": None}
    batch = lidarium.vector_env(2, ROOM, **{"starts": "fixed", **options})
    near, far = (4.2, 3.0, 0.0), (1.0, 1.0, math.pi / 2)
    batch.reset(seed=0, options={"starts": [[near, far], [far, near]]})
    return batch, [batch.step(np.array([AHEAD, STAY, STAY, STAY])) for _ in range(31)]


def test_a_robot_that_ends_early_is_masked_until_its_episode_ends():
    batch, steps = masked_run()
    end = next(k for k, step in enumerate(steps) if step[2][0])
    assert 0 < end < 25
    assert steps[end][4]["ended_because"][0] == "collision"
    assert list(steps[end][4]["_ended_because"]) == [True, False, False, False]
    for observations, rewards, terminated, truncated, infos in steps[:end]:
        assert infos["active"].all()
        assert rewards.all()
        assert not (terminated | truncated).any()
        assert observations["scan"].shape == (4, 36)
    for k in range(end + 1, 30):
        observations, rewards, terminated, truncated, infos = steps[k]
        for name, array in observations.items():
            assert np.array_equal(array[0], steps[end][0][name][0])
        assert rewards[0] == 0.0
        assert list(infos["active"]) == [False, True, True, True]
        assert not terminated.any()
        assert list(truncated) == [k == 29] * 4
    assert list(steps[29][4]["ended_because"]) == [None, "horizon", "horizon", "horizon"]
    begun = steps[30]
    assert begun[4]["active"].all()
    assert not any(part.any() for part in begun[1:4])
    assert not np.array_equal(begun[0]["scan"][0], steps[29][0]["scan"][0])
    assert "final_info" not in begun[4]
    assert not batch.batch.is_over.any()


def test_the_body_of_a_masked_robot_stays_on_the_floor():
    _, steps = masked_run()
    poses = np.array([step[4]["truth"]["pose"][0] for step in steps[:30]])
    end = next(k for k, step in enumerate(steps) if step[2][0])
    assert len(np.unique(poses[end:], axis=0)) == 1
    assert poses[end, 0] > poses[0, 0]


@pytest.mark.parametrize("level", ["velocity", "frontier"])
def test_some_episodes_are_reset_and_the_others_wait(level):
    batch = lidarium.vector_env(3, ROOM, level=level, **FEW, starts="fixed")
    observations, _ = batch.reset(seed=[5, 6, 7])
    actions = np.ones((3, 2)) if level == "velocity" else np.zeros(3, np.int64)
    for _ in range(2):
        moved, *_ = batch.step(actions)
    again, infos = batch.reset(seed=[5, None, 7], options={"episodes": np.array([True, False, True])})
    for name, array in again.items():
        assert np.array_equal(array[[0, 2]], observations[name][[0, 2]])
        assert np.array_equal(array[1], moved[name][1])
    assert infos["active"].all()
    assert set(infos) == TOLD_ALWAYS
    assert list(batch.engine.world.steps) == [0, batch.engine.world.steps[1], 0]
    assert batch.engine.world.steps[1] > 0


def test_what_waits_is_not_told_of_twice():
    batch = lidarium.vector_env(2, ROOM, level="frontier", **FEW, starts="fixed")
    batch.reset(seed=1)
    for _ in range(60):
        *_, infos = batch.step(np.zeros(2, np.int64))
        if "given_up" in infos and infos["_given_up"][0]:
            break
    assert infos["_given_up"][0]
    _, infos = batch.reset(options={"episodes": [False, True]})
    assert set(infos) == TOLD_ALWAYS


def test_what_waits_goes_on_as_if_nothing_had_been_reset():
    runs = []
    for is_disturbed in (False, True):
        batch = lidarium.vector_env(2, ROOM, level="frontier", **FEW, starts="fixed")
        batch.reset(seed=1)
        for k in range(12):
            if is_disturbed and k in (3, 4, 8):
                batch.reset(seed=k, options={"episodes": [False, True]})
            step = batch.step(np.zeros(2, np.int64))
        runs.append((step[0], step[1][0], step[4]["truth"]["pose"][0]))
    for name, array in runs[0][0].items():
        assert np.array_equal(array[0], runs[1][0][name][0])
    assert runs[0][1] == runs[1][1]
    assert np.array_equal(runs[0][2], runs[1][2])


def test_options_of_a_reset_are_for_all_or_for_each_episode():
    batch = lidarium.vector_env(2, ROOM, **FEW, starts="fixed")
    places = np.array([[[1.0, 1.0, 0.5]], [[4.0, 3.0, -0.5]]])
    _, infos = batch.reset(options={"starts": places[0]})
    assert np.allclose(infos["truth"]["pose"], places[0])
    _, infos = batch.reset(options={"starts": places, "colour": "ignored"})
    assert np.allclose(infos["truth"]["pose"], places[:, 0])
    _, infos = batch.reset(seed=3, options={"starts": [None, places[0]]})
    drawn = lidarium.vector_env(1, ROOM, **FEW, starts="fixed").reset(seed=3)[1]["truth"]["pose"][0]
    assert np.array_equal(infos["truth"]["pose"][0], drawn)
    assert np.allclose(infos["truth"]["pose"][1], places[0])
    batch.reset(options={"floor": "apartment"})
    assert [floor.name for floor in batch.engine.floors] == ["apartment", "apartment"]
    batch.reset(options={"floor": [load_floor("clinic"), None]})
    assert [floor.name for floor in batch.engine.floors] == ["clinic", "room"]
    batch.reset()
    assert [floor.name for floor in batch.engine.floors] == ["room", "room"]


def test_goals_are_for_all_or_for_each_episode():
    floor = dataclasses.replace(ROOM, goal=(1.0, 1.0))
    batch = lidarium.vector_env(2, floor, **FEW, starts="fixed")
    assert "goal" in batch.single_observation_space.spaces
    start = np.array([[1.5, 1.5, 0.0]])
    one, another = (2.0, 3.0), (3.0, 2.0)
    for goal, wanted in (
        (one, [one, one]),
        ([one, another], [one, another]),
        ([None, another], [floor.goal, another]),
    ):
        observations, _ = batch.reset(options={"goal": goal, "starts": start})
        away = observations["goal"] - observations["pose"][:, :2]
        assert np.allclose(away, np.array(wanted) - start[0, :2], atol=1e-5)
    batch.reset(options={"goal": [(1.5, 1.5), (3.0, 2.0)], "starts": start})
    _, _, terminated, _, infos = batch.step(np.zeros((2, 2)))
    assert list(terminated) == [True, False]
    assert infos["ended_because"][0] == "reached"


def test_floors_of_different_sizes_and_of_cells_of_different_sizes_are_in_one_batch():
    names = [ROOM, "clinic", "building:3"]
    coarse = load_floor("apartment").raster(0.04, 0.3, 0.3)
    image = dataclasses.replace(load_floor("apartment"), name="image", solids=(), cells=coarse)
    batch = lidarium.vector_env(4, **FEW, starts="fixed")
    batch.reset(seed=0, options={"floor": [*names, image]})
    shapes = {grid.shape for grid in batch.engine.simulation.beliefs.log_odds}
    assert len(shapes) == 4
    for _ in range(5):
        observations, *_ = batch.step(np.tile(AHEAD, (4, 1)))
    assert batch.observation_space.contains(observations)


def test_of_a_set_each_beginning_draws_a_floor(monkeypatch):
    monkeypatch.setattr(catalogue, "SETS", {"train": (5, 3)})
    options = {"horizon_s": 0.1, **FEW}
    batch, alone = (
        lidarium.vector_env(4, "set:train", **options),
        lidarium.parallel_env("set:train", **options),
    )
    batch.reset(seed=2)
    alone.reset(seed=5)
    seen = []
    for _ in range(4):
        seen.append([floor.name for floor in batch.engine.floors])
        assert seen[-1][3] == alone.floor.name
        alone.reset()
        for _ in range(2):
            batch.step(np.zeros((4, 2)))
    assert {name for names in seen for name in names} == {load_floor(f"building:{seed}").name for seed in (5, 6, 7)}


def test_a_list_has_a_seed_for_each_episode():
    batch = lidarium.vector_env(3, ROOM, **FEW, starts="fixed")
    poses = batch.reset(seed=[9, 4, 9])[1]["truth"]["pose"]
    assert np.array_equal(poses[0], poses[2])
    assert not np.array_equal(poses[0], poses[1])
    assert np.array_equal(batch.reset(seed=np.array([4, 5, 6]))[1]["truth"]["pose"][0], poses[1])
    assert np.array_equal(batch.reset(seed=4)[1]["truth"]["pose"][0], poses[1])
    # Noise depends on the seed, never on the row.
    noisy = lidarium.vector_env(2, ROOM, noise="datasheet", **FEW, starts="fixed")
    scans = noisy.reset(seed=[3, 3])[0]["scan"]
    assert np.array_equal(scans[0], scans[1])


def test_observations_are_new_arrays_or_two_sets_that_take_turns():
    fresh = lidarium.vector_env(2, ROOM, **FEW, starts="fixed")
    first, _ = fresh.reset(seed=0)
    kept = {name: array.copy() for name, array in first.items()}
    returned = [first] + [fresh.step(np.ones((2, 2)))[0] for _ in range(4)]
    assert_same(first, kept)
    assert not any(
        np.shares_memory(one["scan"], other["scan"]) for k, one in enumerate(returned) for other in returned[:k]
    )
    turning = lidarium.vector_env(2, ROOM, copy=False, **FEW, starts="fixed")
    reused = [turning.reset(seed=0)[0]]
    last = {name: array.copy() for name, array in reused[0].items()}
    for k in range(1, 5):
        reused.append(turning.step(np.ones((2, 2)))[0])
        assert_same(reused[k - 1], last)
        assert_same(reused[k], returned[k])
        last = {name: array.copy() for name, array in reused[k].items()}
    assert all(np.shares_memory(reused[k]["scan"], reused[k % 2]["scan"]) for k in range(5))


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_in_mid_episode_go_on_alike(duplicate):
    batch = lidarium.vector_env(2, ROOM, level="frontier", **{**FEW, "robots": 2}, starts="fixed")
    batch.reset(seed=0)
    for _ in range(3):
        batch.step(np.zeros(4, np.int64))
    other = duplicate(batch)
    for _ in range(5):
        one, another = batch.step(np.zeros(4, np.int64)), other.step(np.zeros(4, np.int64))
        assert_same(one[0], another[0])
        assert np.array_equal(one[1], another[1])


def test_gymnasiums_wrappers_of_vector_environments_work_on_it():
    batch = DictInfoToList(
        RecordEpisodeStatistics(lidarium.vector_env(2, ROOM, level="waypoint", horizon_s=2.0, **FEW, starts="fixed"))
    )
    _, infos = batch.reset(seed=0)
    total = np.zeros(2)
    for _ in range(30):
        _, rewards, _, truncated, infos = batch.step(np.zeros((2, 2)))
        total += rewards
        if truncated.any():
            break
    assert len(infos) == 2
    assert [info["episode"]["r"] for info in infos] == pytest.approx(total)
    assert infos[0]["ended_because"] == "horizon"


def test_threads_are_those_of_the_machine_unless_named():
    assert lidarium.vector_env(1, starts="fixed").settings.threads == available_threads()
    assert lidarium.vector_env(1, threads=1, starts="fixed").settings.threads == 1
    assert lidarium.vector_env(1, settings=make_settings(threads=3, robots=2), starts="fixed").settings.threads == 3


def test_a_closed_environment_and_one_without_reset_say_what_to_do():
    batch = lidarium.vector_env(2, **FEW, starts="fixed")
    with pytest.raises(RuntimeError, match="not reset; call reset"):
        batch.step(np.zeros((2, 2)))
    batch.reset(options={"episodes": [True, False]})
    with pytest.raises(RuntimeError, match="not reset; call reset"):
        batch.step(np.zeros((2, 2)))
    batch.reset()
    batch.close()
    batch.close()
    for use in (batch.reset, lambda: batch.step(np.zeros((2, 2)))):
        with pytest.raises(RuntimeError, match="closed; make a new one"):
            use()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"episodes": 0}, "number of episodes is 0; want a whole number of at least 1"),
        (
            {"episodes": 10**9},
            r"episodes is 1,000,000,000, which observe .* GiB: want at most [\d,]+, or fewer map_cells",
        ),
        ({"episodes": -1}, "number of episodes is -1"),
        ({"episodes": 2.0}, "number of episodes is 2.0"),
        ({"episodes": True}, "number of episodes is True"),
        ({"episodes": 2, "level": "joint"}, "unknown level 'joint'"),
        ({"episodes": 2, "render_mode": "human"}, "want rgb_array or None"),
        (
            {"episodes": 2, "floor": []},
            r"floor is \[\]; want a name",
        ),
        ({"episodes": 2, "floor": "apartmnt"}, "did you mean 'apartment'"),
        ({"episodes": 2, "resolution": 0.03}, "want a whole multiple of raster_resolution 0.025 m"),
        ({"episodes": 2, "robots": 0}, "robots is 0"),
    ],
)
def test_batches_that_cannot_be_are_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        lidarium.vector_env(**arguments)


def test_make_vec_refuses_teams_and_none():
    with pytest.raises(ValueError, match=r"use lidarium\.vector_env for teams"):
        gymnasium.make_vec("lidarium/Exploration-v1", 2, robots=2)
    with pytest.raises(ValueError, match="number of episodes is 0"):
        gymnasium.make_vec("lidarium/Exploration-v1", 0)


@pytest.mark.parametrize(
    ("seed", "options", "words"),
    [
        ([1, 2], None, "seed has 2 entries; want one number, or one entry for each of the 3 episodes"),
        ([1, 2, -3], None, "seed is -3; want a whole number"),
        (-1, None, "seed is -1; want a whole number"),
        (1.5, None, "seed is 1.5; want a whole number"),
        ("abc", None, "seed is 'abc'; want a whole number"),
        (None, {"episodes": [True, False]}, "want a mask of 3 booleans"),
        (None, {"episodes": [0, 1, 1]}, "want a mask of 3 booleans"),
        (None, {"episodes": [False] * 3}, "at least one of them True"),
        (
            None,
            {"floor": ["apartment", "clinic"]},
            "option floor has 2 entries; want one for all, or one for each of the 3 episodes",
        ),
        (None, {"floor": 17}, "floor is 17; want a name"),
        (None, {"floor": "clinc"}, "did you mean 'clinic'"),
        (None, {"starts": np.zeros((2, 1, 3))}, "option starts has 2 entries"),
        (None, {"starts": np.zeros((3, 2, 3))}, r"option starts has shape \(2, 3\); want \(1, 3\)"),
        (None, {"starts": [(1.0, 2.0)]}, r"option starts has shape \(1, 2\); want \(1, 3\)"),
        (None, {"starts": [[1.0, 2.0, math.nan]]}, "option starts is .*numbers up to"),
        (None, {"starts": [["a", "b", "c"]]}, "option starts is .*numbers up to"),
        (None, {"goal": [(1.0, 2.0)]}, "option goal has 1 entries"),
        (None, {"goal": (1.0, math.inf)}, "option goal is .*two numbers up to 1e"),
    ],
)
def test_resets_that_cannot_be_are_refused_and_change_nothing(seed, options, words):
    batch = lidarium.vector_env(3, ROOM, **FEW, starts="fixed")
    before = batch.reset(seed=1)[1]["truth"]["pose"]
    with pytest.raises(ValueError, match=words):
        batch.reset(seed=seed, options=options)
    _, _, _, _, infos = batch.step(np.zeros((3, 2)))
    assert np.array_equal(infos["truth"]["pose"], before)


@pytest.mark.parametrize(
    ("level", "actions", "words"),
    [
        ("velocity", np.zeros((2, 2)), r"actions have shape \(2, 2\); want \(3, 2\)"),
        ("velocity", np.zeros(6), r"actions have shape \(6,\); want \(3, 2\)"),
        (
            "velocity",
            [[0.0, 0.0], [0.0, math.nan], [0.0, 0.0]],
            r"the action of row 1 is \[ *0. *nan\], nan or infinite; want two finite",
        ),
        ("waypoint", [[0.0, 0.0], [0.0, 0.0], [math.inf, 0.0]], "the action of row 2 is .*nan or infinite"),
        ("waypoint", [[0.0, 0.0], [0.0], [0.0, 0.0]], r"actions are .*; want an array \(3, 2\)"),
        ("velocity", [["a", "b"]] * 3, "actions are of type <U1; want two finite numbers"),
        ("velocity", None, "actions is None; want an action for each row"),
        (
            "frontier",
            np.zeros((3, 2)),
            r"actions have shape \(3, 2\); want \(3,\): a whole number from 0 to 32",
        ),
        ("frontier", [0, 33, 0], "the action of row 1 is 33; want a whole number from 0 to 32, 32 to stay"),
        ("frontier", [0, 0, -1], "the action of row 2 is -1"),
        ("frontier", [0.0, 0.5, 0.0], "the action of row 1 is 0.5"),
        ("frontier", [math.nan, 0, 0], "the action of row 0 is nan"),
    ],
)
def test_actions_that_cannot_be_are_refused_and_change_nothing(level, actions, words):
    batch = lidarium.vector_env(3, ROOM, level=level, **FEW, starts="fixed")
    before = batch.reset(seed=1)[1]["truth"]["pose"]
    with pytest.raises(ValueError, match=words):
        batch.step(actions)
    assert np.array_equal(batch.engine.world.poses, before)
    assert (batch.engine.world.steps == 0).all()


def test_actions_of_rows_that_do_not_act_are_ignored():
    batch = lidarium.vector_env(2, ROOM, horizon_s=0.1, **FEW, starts="fixed")
    batch.reset(seed=0)
    assert batch.step(np.zeros((2, 2)))[3].all()
    observations, *_ = batch.step(np.full((2, 2), np.nan))
    assert batch.observation_space.contains(observations)


@pytest.mark.parametrize("threads", [1, 2])
def test_scans_of_as_many_beams_as_there_may_be_find_room_on_the_stacks_of_all_threads(threads):
    lidar = Lidar(beams=MAX_BEAMS, field_of_view=2.0 * math.pi, range_max=12.0, noise_floor=0.01)
    batch = lidarium.vector_env(
        8,
        "apartment",
        lidar=lidar,
        observe=["scan", "egocentric_map"],
        egocentric_cells=1024,
        threads=threads,
        starts="fixed",
    )
    batch.reset(seed=0)
    for _ in range(2):
        observations, _, _, _, infos = batch.step(batch.action_space.sample())
    assert np.all(infos["truth"]["coverage"] > 0.0)
    assert np.all(observations["scan"].min(axis=1) > 0.0)


@pytest.mark.parametrize("ended", ["leave", "zeros"])
def test_results_are_the_users_own_arrays(ended):
    options = {"robots": 2, "observe": ["scan"], "lidar": {"beams": 40}, "ended_agents": ended, "horizon_s": 30.0}
    given, kept = (lidarium.vector_env(2, "apartment", **options) for _ in range(2))
    for env in (given, kept):
        env.reset(seed=0)
        env.team(0).stop("robot_0", "done")
    for step in range(4):
        *found, _ = given.step(np.zeros((4, 2)))
        *wanted, _ = kept.step(np.zeros((4, 2)))
        assert found[2] is not found[3]
        for one, other in zip((found[0]["scan"], *found[1:]), (wanted[0]["scan"], *wanted[1:]), strict=True):
            assert np.array_equal(one, other), step
        # A user's time limit, normalisation and taking apart, in place.
        found[3][:] = True
        found[0]["scan"] /= 10.0
        found[0].pop("scan")
    found, _ = given.reset(seed=[None, 3], options={"episodes": np.array([False, True])})
    wanted, _ = kept.reset(seed=[None, 3], options={"episodes": np.array([False, True])})
    assert np.array_equal(found["scan"], wanted["scan"])


def test_episodes_that_have_not_begun_show_zeros():
    env = lidarium.vector_env(2, "apartment", robots=1, observe=["scan", "velocity"], lidar={"beams": 40})
    observations, _ = env.reset(seed=0, options={"episodes": np.array([True, False])})
    assert env.observation_space.contains(observations)
    assert not observations["scan"][1].any()


def test_a_target_in_one_episode_does_not_change_another():
    def result(first):
        env = lidarium.vector_env(2, "scene_room", robots=2, observe=["velocity"], lidar={"beams": 60})
        env.reset(seed=3)
        drive = dict.fromkeys(("robot_0", "robot_1"), np.array([1.0, 0.2], np.float32))
        env.step([drive, dict.fromkeys(drive, lidarium.Target(0.0, 0.0)) if first else drive])
        env.step([drive, drive])
        env.team(0).stop("robot_0", "done")
        env.step([drive, drive])
        return env.engine.world.poses[:2].copy()

    assert np.array_equal(result(True), result(False))
