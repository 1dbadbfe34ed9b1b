"""Observations: what is chosen and nothing else, written where the caller wants it, the same however it is
asked for."""

import copy
import math
import pickle
from itertools import combinations

import gymnasium
import numpy as np
import pytest
from all_observed import ALL

import lidarium
from lidarium.agents.random_walk import RandomWalk
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor
from lidarium.envs.observing.spaces import observation_space
from lidarium.envs.observing.writer import ObservationWriter
from lidarium.envs.settings.exploration import OBSERVABLES
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.mapping.grids.map_crops import crop_turned

SMALL = {"map_cells": 32, "egocentric_cells": 16, "egocentric_scales": (1, 2, 3)}
GOAL_FLOOR = Floor(
    "box", (0.0, 0.0, 5.0, 4.0), (), starts=np.array([[1.0, 1.0, 0.0], [1.0, 3.0, 0.5]]), goal=(4.0, 3.0)
)


def driven(steps=15, floor="building:5", **options):
    """An environment in mid-episode, and its last observations."""
    env = lidarium.parallel_env(
        floor,
        **{
            "starts": "fixed",
            "robots": 3,
            "stop_coverage": None,
            "noise": "datasheet",
            "observe": ALL,
            **SMALL,
            **options,
        },
    )
    observations, _ = env.reset(seed=2)
    generator = np.random.default_rng(0)
    for _ in range(steps):
        observations = env.step({agent: generator.uniform(-1.0, 1.0, 2).astype(np.float32) for agent in env.agents})[0]
    return env, observations


def writer_of(env, offsets=None, goals=None, **options):
    return ObservationWriter(
        env.simulation,
        make_settings(env.settings, **options),
        env.perception.offsets if offsets is None else offsets,
        goals,
    )


def written(writer):
    """Return the observations of all rows."""
    out = writer.buffers()
    writer.write(out)
    return out


OFFSETS = np.zeros((9, 2))


@pytest.mark.parametrize("options", [{}, {"noise": "datasheet"}, {"level": "waypoint"}])
def test_who_names_nothing_sees_all_but_the_pose_and_the_egocentric_map(options):
    names = ["scan", "velocity", "bumper", "map"]
    env = lidarium.parallel_env("scene_room", robots=2, **{"starts": "fixed", **options})
    observations, _ = env.reset(seed=0)
    assert list(observations["robot_0"]) == names
    assert set(env.observation_space("robot_0").spaces) == set(names)
    batch = lidarium.vector_env(1, "scene_room", robots=2, **{"starts": "fixed", **options})
    assert list(batch.reset(seed=0)[0]) == names


def test_settings_that_are_given_whole_show_what_they_name():
    env = lidarium.parallel_env("scene_room", settings=make_settings(robots=1), starts="fixed")
    assert list(env.reset(seed=0)[0]["robot_0"]) == list(ALL)
    batch = lidarium.vector_env(1, "scene_room", settings=make_settings(robots=1, observe=["pose"]), starts="fixed")
    assert list(batch.reset(seed=0)[0]) == ["pose"]


@pytest.mark.parametrize("names", [*combinations(OBSERVABLES, 1), *combinations(OBSERVABLES, 2), OBSERVABLES])
def test_what_is_observed_does_not_depend_on_what_else_is(names):
    env, _ = driven(8)
    everything = written(writer_of(env, OFFSETS[:3], observe=OBSERVABLES))
    chosen = written(writer_of(env, OFFSETS[:3], observe=names))
    assert tuple(chosen) == names
    for name, array in chosen.items():
        assert np.array_equal(array, everything[name])
        assert array.dtype == everything[name].dtype


@pytest.mark.parametrize("level", ["velocity", "waypoint", "frontier"])
@pytest.mark.parametrize("observe", [["egocentric_map"], ["map", "scan"], ["bumper", "egocentric_map", "pose"]])
@pytest.mark.parametrize("floor", ["scene_room", GOAL_FLOOR])
def test_any_choice_is_observed_at_every_level_and_lies_in_its_space(level, observe, floor):
    env = lidarium.parallel_env(
        floor, level=level, robots=2, observe=observe, stop_coverage=None, **SMALL, starts="fixed"
    )
    added = {"frontiers", "action_mask"} if level == "frontier" else set()
    goal = {"goal"} if isinstance(floor, Floor) else set()
    observations, _ = env.reset(seed=1)
    for _ in range(2):
        for agent, observation in observations.items():
            assert set(observation) == set(observe) | added | goal
            assert env.observation_space(agent).contains(observation)
        observations = env.step({agent: 0 if level == "frontier" else np.zeros(2, np.float32) for agent in env.agents})[
            0
        ]


def test_the_order_of_the_names_does_not_matter():
    one, other = (make_settings(observe=names) for names in (["map", "scan"], ("scan", "map")))
    assert one == other
    assert hash(one) == hash(other)
    assert list(observation_space(one, has_goal=True).spaces) == list(observation_space(other, has_goal=True).spaces)


def pooled(log_odds, scale):
    rows, columns = (-(-size // scale) * scale for size in log_odds.shape)
    padded = np.zeros((rows, columns), np.int8)
    padded[: log_odds.shape[0], : log_odds.shape[1]] = log_odds
    return np.ascontiguousarray(padded.reshape(rows // scale, scale, columns // scale, scale).max(axis=(1, 3)))


def test_the_egocentric_map_is_turned_about_the_corner_nearest_to_where_the_robot_believes_to_be():
    env, observations = driven(observe=["egocentric_map"])
    for row, agent in enumerate(env.agents):
        x, y = (env.beliefs.believed[row, :2] - env.beliefs.origins[row]) / env.settings.occupancy.resolution
        expected = np.zeros((3, 16, 16), np.uint8)
        pools = [env.beliefs.log_odds[row], *(pooled(env.beliefs.log_odds[row], scale) for scale in (2, 3))]
        table = np.array([(pool.ctypes.data, *pool.shape) for pool in pools], np.int64)
        crop_turned(table, x, y, env.beliefs.believed[row, 2], np.array([1, 2, 3]), expected)
        assert np.array_equal(observations[agent]["egocentric_map"], expected)
        assert np.unique(expected).size > 1


def test_the_egocentric_map_does_not_tell_the_heading_on_the_floor():
    """A robot in the middle of a square room sees the same whichever wall it looks at."""
    crops = []
    for quarter in range(4):
        room = Floor("room", (0.0, 0.0, 4.0, 4.0), (), starts=np.array([[2.0, 2.0, quarter * math.pi / 2.0]]))
        env = lidarium.parallel_env(
            room, robots=1, lidar="lidar_360_6m", stop_coverage=None, observe=["egocentric_map"], starts="fixed"
        )
        crops.append(env.reset(seed=0)[0]["robot_0"]["egocentric_map"])
    for crop in crops[1:]:
        # A wall that lies on the border of cells falls to one side or the other.
        assert (crop != crops[0]).mean() < 0.02


def test_a_row_is_the_observation_of_its_agent():
    env, observations = driven(observe=OBSERVABLES)
    out = written(writer_of(env))
    for row, agent in enumerate(env.agents):
        for name, array in observations[agent].items():
            assert np.array_equal(out[name][row], array)


@pytest.mark.parametrize("observe", [OBSERVABLES, ("scan", "egocentric_map")])
def test_rows_that_are_not_active_keep_what_they_hold(observe):
    env, _ = driven(floor=GOAL_FLOOR, robots=2)
    writer = writer_of(env, goals=np.array([[4.0, 3.0]] * 2), observe=observe)
    whole = written(writer)
    for active in ([False, False], [True, False], [False, True]):
        out = {name: np.full_like(array, 77) for name, array in whole.items()}
        writer.write(out, np.array(active))
        for name, array in out.items():
            for row, is_active in enumerate(active):
                assert np.array_equal(array[row], whole[name][row] if is_active else np.full_like(array[row], 77))


def test_threads_do_not_change_an_observation():
    found = []
    for threads in (1, 2):
        env, _ = driven(5, robots=9, threads=threads, observe=OBSERVABLES)
        active = np.arange(9) % 4 != 1
        out = {name: np.zeros_like(array) for name, array in writer_of(env).buffers().items()}
        writer_of(env, OFFSETS).write(out, active)
        found.append((written(writer_of(env, OFFSETS)), out))
    for one, other in zip(*found, strict=True):
        for name, array in one.items():
            assert np.array_equal(array, other[name])


def test_a_goal_is_in_the_frame_of_the_pose_and_zero_where_it_is_not_known():
    env, observations = driven(floor=GOAL_FLOOR, robots=2, observe=["pose"])
    for agent, offset in zip(env.agents, env.perception.offsets, strict=True):
        assert np.array_equal(observations[agent]["goal"], (np.array([4.0, 3.0]) - offset).astype(np.float32))
    _, observations = driven(floor=GOAL_FLOOR, robots=2, observe=["pose"], known_starts=False)
    assert all(not observation["goal"].any() for observation in observations.values())
    goals = np.array([[np.nan, np.nan], [4.0, 3.0]])
    goal = written(writer_of(env, goals=goals))["goal"]
    assert goal[0].tolist() == [0.0, 0.0]
    assert goal[1].any()
    assert "goal" not in written(writer_of(env))


def test_a_writer_reads_frames_and_goals_as_they_are_at_each_call():
    env, _ = driven(3, observe=["pose"])
    offsets, goals = np.zeros((3, 2)), np.full((3, 2), 2.0)
    writer = writer_of(env, offsets, goals)
    before = written(writer)
    offsets += 1.0
    goals += 2.0
    after = written(writer)
    assert np.allclose(before["pose"][:, :2] - after["pose"][:, :2], 1.0, atol=1e-6)
    assert np.allclose(after["goal"] - before["goal"], 1.0)


@pytest.mark.parametrize(
    "copied", [copy.deepcopy, lambda pair: pickle.loads(pickle.dumps(pair))], ids=["deepcopy", "pickle"]
)
def test_a_copied_writer_tells_of_the_copied_world(copied):
    env, _ = driven(3)
    writer = writer_of(env)
    before = written(writer)
    other, twin = copied((env, writer))
    other.step({agent: np.ones(2, np.float32) for agent in other.agents})
    told, expected = written(twin), written(writer_of(other))
    assert all(np.array_equal(array, expected[name]) for name, array in told.items())
    assert not np.array_equal(told["pose"], before["pose"])
    assert np.array_equal(written(writer)["pose"], before["pose"])


@pytest.mark.parametrize(
    ("offsets", "words"),
    [
        (np.zeros((3, 3))[:, :2], r"offsets are float64 \(3, 2\); want float64 \(3, 2\), contiguous"),
        (np.zeros((3, 2), np.float32), "offsets are float32"),
        (np.zeros((2, 2)), r"offsets are float64 \(2, 2\)"),
    ],
)
def test_frames_that_cannot_be_read_are_refused(offsets, words):
    env, _ = driven(1)
    with pytest.raises(ValueError, match=words):
        writer_of(env, offsets)


def test_the_gymnasium_form_takes_the_choice():
    env = gymnasium.make(
        "lidarium/Exploration-v1", observe=["egocentric_map"], egocentric_cells=32, egocentric_scales=[2]
    )
    observation, _ = env.reset(seed=0)
    assert {name: array.shape for name, array in observation.items()} == {"egocentric_map": (1, 32, 32)}
    env.close()


def test_explorers_need_no_observation_and_the_random_walk_says_which_it_needs():
    ends = []
    for observe in (["scan", "map"], ["egocentric_map"], ["velocity"]):
        env = ExplorationEnv("scene_room", make_settings(robots=2, horizon_s=20.0, observe=observe, **SMALL))
        run_episode(lidarium.policy("nearest_frontier"), env, 1)
        assert (env.world.travelled > 0.5).all()
        ends.append(env.world.poses)
    assert all(np.array_equal(end, ends[0]) for end in ends)
    with pytest.raises(ValueError, match=r"RandomWalk needs scan, bumper, which .* observe"):
        run_episode(RandomWalk(), ExplorationEnv("scene_room", make_settings(robots=1, observe=["pose"], **SMALL)), 1)


def test_a_frame_is_drawn_whatever_is_observed():
    env, _ = driven(1, floor="scene_room", observe=["velocity"], render_mode="rgb_array")
    assert env.render().any()
