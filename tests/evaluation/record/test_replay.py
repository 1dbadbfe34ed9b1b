"""Recorded episodes run again."""

from dataclasses import replace

import numpy as np
import pytest

from lidarium.agents import Policy, Stop
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import Recorder, read_record, rerun, write_record
from lidarium.evaluation.record.replay import drive_again, find_floor, is_same, state_sha256
from lidarium.mapping.files.map_files import write_ros_map


class FirstFrontier(Policy):
    """Takes the cheapest frontier on offer."""

    level, shares_map = "frontier", True

    def reset(self, team, seed):
        self.team = team

    def act(self, observations):
        return {agent: 0 if observation["action_mask"][0] else 16 for agent, observation in observations.items()}


class Leaves(Policy):
    """Turns on the spot; one robot after the other stops, with words that the environment uses too."""

    level, shares_map = "velocity", True
    reasons = ("covered", "horizon", "tired")

    def reset(self, team, seed):
        self.steps = 0

    def act(self, observations):
        self.steps += 1
        spin = np.array([0.3, 0.7], np.float32)
        return {
            agent: Stop(self.reasons[int(agent[-1])]) if self.steps > 5 * (int(agent[-1]) + 1) else spin
            for agent in observations
        }


def array_of(env, name):
    """The array of an environment, of whichever part of its simulation has it."""
    owners = (env.world, env.beliefs, env.score, env.simulation)
    return next(getattr(owner, name) for owner in owners if hasattr(owner, name))


def assert_same(again, env):
    """Assert that two environments are in the same state, array by array."""
    for name in (
        "poses",
        "velocities",
        "believed",
        "ranges",
        "seen",
        "team_seen",
        "travelled",
        "collisions",
        "steps",
    ):
        np.testing.assert_array_equal(array_of(again, name), array_of(env, name), err_msg=name)
    for name in ("log_odds", "masks", "team_masks"):
        for here, there in zip(array_of(again, name), array_of(env, name), strict=True):
            np.testing.assert_array_equal(here, there, err_msg=name)
    assert again.scorer.ended_because == env.scorer.ended_because
    assert again.scorer.curve == env.scorer.curve
    assert again.agents == env.agents


@pytest.mark.parametrize(
    "setup",
    [
        {"policy": "nearest_frontier", "robots": 3},
        {"policy": FirstFrontier(), "horizon_s": 30.0},
        {"policy": "random_walk", "horizon_s": 30.0},
        {"policy": Leaves(), "robots": 3},
        {"policy": "nearest_frontier", "horizon_s": 20.0, "noise": "datasheet"},
        {"policy": "nearest_frontier_own_map", "horizon_s": 20.0, "known_starts": False, "noise": "thesis"},
        {
            "policy": "random_walk",
            "horizon_s": 120.0,
            "robots": 3,
            "stop_on_contact": True,
            "floor": "scene_room",
        },
        {"policy": "nearest_frontier", "horizon_s": 10.0, "floor": "set:test"},
        {
            "policy": "nearest_frontier",
            "horizon_s": 10.0,
            "floor": "building:17",
            "robot": "service",
            "lidar": "lidar_360_6m",
        },
        {
            "policy": "nearest_frontier",
            "horizon_s": 10.0,
            "options": {"starts": [(2.5, 4.0, 1.0), (6.0, 4.5, 7.0)]},
        },
        {"policy": "nearest_frontier", "horizon_s": 10.0, "options": {"floor": "clinic"}},
        {
            "policy": "nearest_frontier",
            "horizon_s": 10.0,
            "time_step": 0.05,
            "resolution": 0.025,
            "map_cells": 64,
        },
    ],
    ids=lambda setup: "-".join(
        f"{value if isinstance(value, str | float | int) else type(value).__name__}" for value in setup.values()
    ),
)
def test_a_record_runs_again_to_the_bit(recorded, setup, tmp_path):
    record, env = recorded(**setup)
    write_record(tmp_path / "episode.npz", record)
    assert_same(rerun(read_record(tmp_path / "episode.npz")), env)


def test_robots_that_end_early_end_again_at_the_same_step(recorded):
    record, env = recorded(Leaves(), robots=3)
    assert record.header["endings"] == [
        [6, "robot_0", "covered"],
        [11, "robot_1", "horizon"],
        [16, "robot_2", "tired"],
    ]
    assert_same(rerun(record), env)


def test_a_goal_that_is_reached_ends_a_robot_again():
    floor = replace(load_floor("apartment"), starts=np.array([(2.5, 4.0, 0.0)]), goal=(2.9, 4.0))
    recorder = Recorder()
    env = WatchedExploration(floor, make_settings(robots=1), watchers=[recorder])
    env.reset(seed=0, options={"goal": (3.2, 4.0)})
    while env.agents:
        env.step({"robot_0": np.array([0.5, 0.0])})
    record = recorder.finish()
    assert record.header["endings"][0][1:] == ["robot_0", "reached"]
    assert_same(rerun(record, floor), env)
    with pytest.raises(ValueError, match=r"is not found.*name the floor"):
        rerun(record)


def test_later_episodes_of_one_seed_run_again():
    recorder = Recorder()
    env = WatchedExploration("apartment", make_settings(robots=2, noise="datasheet"), watchers=[recorder])
    env.reset(seed=5)
    env.reset()
    for _ in range(30):
        env.step(dict.fromkeys(env.agents, np.array([0.4, 0.1])))
    assert_same(rerun(recorder.finish()), env)


def test_whoever_looks_on_sees_the_episode_again(recorded, apartment_record):
    recorder = Recorder("again", 3)
    rerun(apartment_record, watchers=[recorder])
    again = recorder.finish()
    np.testing.assert_array_equal(again.commands, apartment_record.commands)
    np.testing.assert_array_equal(again.display.poses, apartment_record.display.poses)
    np.testing.assert_array_equal(again.display.changes.known, apartment_record.display.changes.known)


def test_commands_that_differ_in_the_twelfth_digit_are_noticed(apartment_record):
    commands = apartment_record.commands.copy()
    commands[100:110] *= 1.0 + 1e-12
    changed = replace(apartment_record, commands=commands)
    assert not is_same(changed, drive_again(changed))
    with pytest.raises(ValueError, match="does not run as it was recorded"):
        rerun(changed)


def test_a_run_that_leaves_the_recorded_ways_is_told_when_and_where(apartment_record):
    commands = apartment_record.commands.copy()
    commands[200:, 1] = 0.0
    with pytest.raises(ValueError, match=r"robot_1 is 0\.0.. m off at 20\.. s"):
        rerun(replace(apartment_record, commands=commands))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"version": "0.0.7"}, r"of lidarium 0\.0\.7, this is"),
        ({"floor_sha256": "0" * 64}, "apartment has the hash .* 000000000000"),
        ({"floor": "attic", "floor_source": None}, "no floor called 'attic'"),
        ({"settings_sha256": "0" * 64}, "settings of the record have the hash"),
        ({"settings": {}}, "settings of the record are not those"),
        ({"final_sha256": None}, "broken off within a time step"),
    ],
)
def test_a_record_that_cannot_run_again_is_refused(apartment_record, changes, words):
    with pytest.raises(ValueError, match=words):
        rerun(replace(apartment_record, header={**apartment_record.header, **changes}))


def test_settings_of_another_version_are_named(apartment_record):
    settings = {**apartment_record.header["settings"], "wheels": 4}
    with pytest.raises(ValueError, match="wheels"):
        rerun(replace(apartment_record, header={**apartment_record.header, "settings": settings}))


def test_a_floor_from_a_file_is_found_again_or_asked_for(recorded, tmp_path):
    levels = np.zeros((40, 60), np.uint8)
    levels[2:38, 2:58] = 255
    path = write_ros_map(tmp_path, "hall", levels, (0.0, 0.0, 0.0), 0.1)
    record, env = recorded(floor=str(path), horizon_s=5.0)
    assert record.header["floor_source"] == str(path)
    assert_same(rerun(record), env)
    moved = path.rename(tmp_path / "moved.yaml")
    with pytest.raises(ValueError, match=r"hall\.yaml.*name the floor that was recorded"):
        rerun(record)
    assert_same(rerun(record, moved), env)
    levels[20, 30] = 0
    other = write_ros_map(tmp_path, "other", levels, (0.0, 0.0, 0.0), 0.1)
    with pytest.raises(ValueError, match="has the hash"):
        find_floor(record.header, other)


def test_the_hash_of_a_state_covers_poses_scans_maps_masks_and_endings():
    env = ExplorationEnv("scene_room", make_settings(robots=1))
    env.reset(seed=0)
    world, hashes = env.world, {state_sha256(env)}
    for change in (
        lambda: world.poses.__setitem__((0, 0), np.nextafter(world.poses[0, 0], 9.0)),
        lambda: world.velocities.__setitem__((0, 1), 1e-300),
        lambda: env.simulation.ranges.__setitem__((0, 5), np.float32(1.0)),
        lambda: env.beliefs.log_odds[0].__setitem__((0, 0), 1),
        lambda: env.score.masks[0].__setitem__((0, 0), np.uint64(1)),
        lambda: env.score.seen.__setitem__(0, 1),
        lambda: env.scorer.ended_because.update(robot_0="stopped"),
    ):
        change()
        hashes.add(state_sha256(env))
    assert len(hashes) == 8


def test_the_same_episode_has_the_same_hash_and_what_is_made_of_a_state_does_not_count():
    hashes = set()
    for observe in (("scan",), ("scan", "pose")):
        env = ExplorationEnv("scene_room", make_settings(robots=1, observe=observe))
        env.reset(seed=0)
        hashes.add(state_sha256(env))
    assert len(hashes) == 1
