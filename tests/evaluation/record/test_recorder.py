"""Records of episodes as they run."""

import math

import numba
import numpy as np
import pytest

import lidarium
from lidarium.agents import Policy
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.evaluation.record import Recorder
from lidarium.evaluation.record.recorder import MapSampler, made_with
from lidarium.evaluation.truth.beliefs import team_log_odds
from lidarium.mapping.grids.occupancy import three_levels


class MapLog(Watcher):
    """Keeps the true team map and poses at some steps."""

    def __init__(self):
        self.maps, self.poses, self.targets = {}, {}, {}

    def begin(self, env):
        self.look(env)

    def step(self, env, commands):
        if int(env.world.steps[0]) % 20 == 0:
            self.look(env)
        self.poses[env.scorer.time] = env.world.poses.copy()

    def outcome(self, env):
        if not env.agents:
            self.look(env)

    def look(self, env):
        self.maps[env.scorer.time] = three_levels(team_log_odds(env)[0])


class Sends(Policy):
    """Sends robot_0 to one place after the other, and lets robot_1 rest."""

    level, shares_map = "waypoint", True

    def reset(self, team, seed):
        self.team, self.decisions = team, 0

    def act(self, observations):
        self.decisions += 1
        return {"robot_0": np.array([0.05 * (1 + self.decisions // 3), 0.0], np.float32), "robot_1": None}


class Rams(Policy):
    """Drives into walls and teammates at full speed, backs off and comes again."""

    level, shares_map = "velocity", True

    def reset(self, team, seed):
        self.steps = 0

    def act(self, observations):
        self.steps += 1
        return {agent: np.array([1.0 if self.steps % 50 < 40 else -0.5, 0.0], np.float32) for agent in observations}


@pytest.mark.parametrize(
    "setup",
    [
        {"robots": 3},
        {"known_starts": False, "horizon_s": 24.1, "noise": "datasheet"},
        {"policy": "random_walk", "horizon_s": 24.0, "noise": "thesis", "robots": 3},
        {"policy": "random_walk", "horizon_s": 24.0, "known_starts": False, "robots": 1, "time_step": 0.2},
        {"floor": "building:23", "robots": 3, "resolution": 0.1, "horizon_s": 24.0, "robot": "pioneer"},
    ],
    ids=["apartment", "unknown-starts", "noise", "one-robot", "large"],
)
def test_the_recorded_map_is_the_teams_map_at_every_sample(recorded, setup):
    log = MapLog()
    setup = {"policy": "nearest_frontier", **setup}
    record, env = recorded(watchers=[log], **setup)
    display = record.display
    if setup.get("time_step", 0.1) == 0.1:
        np.testing.assert_array_equal(display.changes.times, sorted(log.maps))
    for time, levels in log.maps.items():
        if time in display.changes.times:
            np.testing.assert_array_equal(display.map_at(time), levels)
    assert display.origin == team_log_odds(env)[1]
    assert display.resolution == env.settings.occupancy.resolution


def test_between_samples_the_map_is_that_of_the_last_one(apartment_record):
    display = apartment_record.display
    np.testing.assert_array_equal(display.map_at(3.9), display.map_at(2.0))
    assert (display.map_at(4.0) != display.map_at(2.0)).any()
    assert (display.map_at(-1.0) == 127).all()
    np.testing.assert_array_equal(display.map_at(math.inf), display.map_at(display.times[-1]))


def test_poses_come_five_times_a_second_and_at_the_end(recorded):
    log = MapLog()
    record, _ = recorded("random_walk", horizon_s=5.1, watchers=[log])
    times, poses = record.display.times, record.display.poses
    np.testing.assert_allclose(times, [*np.arange(26) * 0.2, 5.1])
    for time, recorded_poses in zip(times[1:], poses[1:], strict=True):
        assert np.abs(recorded_poses - log.poses[time]).max() <= 0.5e-3 + 1e-9
    np.testing.assert_array_equal(record.display.poses_at(5.05), poses[-2])
    np.testing.assert_array_equal(record.display.poses_at(-1.0), poses[0])


def test_coverage_is_the_scorers_curve(recorded):
    record, env = recorded(horizon_s=20.0)
    assert [tuple(change) for change in record.display.coverage.tolist()] == env.scorer.curve
    assert record.display.coverage_at(math.inf) == env.scorer.coverage
    assert record.display.coverage_at(-1.0) == 0.0


def test_decisions_tell_where_a_robot_was_sent_and_when(recorded):
    record, _ = recorded(Sends(), horizon_s=15.0)
    told = [event for event in record.display.events if event["kind"] == "decision"]
    assert {event["agent"] for event in told} == {"robot_0"}
    first = record.display.poses[0, 0]
    # Half the side of the observed map is 6.4 m; the target lies along the axes of the floor.
    assert told[0]["time_s"] == 0.0
    assert (told[0]["x"], told[0]["y"]) == pytest.approx((first[0] + 0.05 * 6.4, first[1]), abs=2e-3)
    assert len(told) >= 3


def test_decisions_with_unknown_starts_are_in_the_floors_frame(recorded):
    record, env = recorded(known_starts=False, horizon_s=10.0)
    x_min, y_min, x_max, y_max = env.floor.bounds
    told = [event for event in record.display.events if event["kind"] == "decision" and event["x"] is not None]
    assert {event["agent"] for event in told} == {"robot_0", "robot_1"}
    assert all(x_min <= event["x"] <= x_max and y_min <= event["y"] <= y_max for event in told)


def test_what_is_given_up_is_told_once_with_its_place(recorded):
    record, env = recorded(robots=3, resolution=0.025)
    told = [event for event in record.display.events if event["kind"] == "given_up"]
    assert told
    assert len({(event["agent"], event["x"], event["y"], event["size_m"], event["reason"]) for event in told}) == len(
        told
    )
    assert all(0.0 <= event["time_s"] <= env.scorer.time for event in told)


def test_contacts_are_told_when_they_begin(recorded):
    record, env = recorded(Rams(), floor="scene_room", robots=3, horizon_s=30.0)
    told = [event["agent"] for event in record.display.events if event["kind"] == "contact"]
    assert told
    assert [told.count(agent) for agent in env.possible_agents] == env.world.collisions.tolist()


def test_endings_close_the_events(recorded):
    record, _ = recorded(horizon_s=3.0)
    assert record.display.events[-2:] == [
        {"time_s": 3.0, "kind": "ended", "agent": "robot_0", "reason": "horizon"},
        {"time_s": 3.0, "kind": "ended", "agent": "robot_1", "reason": "horizon"},
    ]


def test_others_add_events_of_their_own():
    recorder = Recorder()
    env = WatchedExploration("scene_room", make_settings(robots=2, horizon_s=1.0), watchers=[recorder])
    env.reset(seed=0)
    recorder.note("message", 0.4, "robot_1", to="robot_0", bytes=120)
    recorder.note("merge", 0.2, None, maps=["robot_0", "robot_1"], accepted=True)
    assert recorder.finish().display.events == [
        {"time_s": 0.2, "kind": "merge", "agent": None, "maps": ["robot_0", "robot_1"], "accepted": True},
        {"time_s": 0.4, "kind": "message", "agent": "robot_1", "to": "robot_0", "bytes": 120},
    ]


def test_the_header_names_no_machine_path_but_the_users_own(recorded):
    record, _ = recorded(horizon_s=1.0)
    assert record.header["floor_source"] == "apartment"
    assert "/" not in str({name: value for name, value in record.header.items() if name != "settings"})


def test_a_recorded_episode_is_the_same_as_one_that_is_not(recorded):
    _, env = recorded(horizon_s=20.0, noise="datasheet", known_starts=False)
    alone = WatchedExploration("apartment", env.settings)
    run_episode(lidarium.policy("nearest_frontier"), alone, 3)
    np.testing.assert_array_equal(alone.world.poses, env.world.poses)
    np.testing.assert_array_equal(alone.beliefs.log_odds, env.beliefs.log_odds)
    np.testing.assert_array_equal(alone.beliefs.windows, env.beliefs.windows)


def test_an_episode_broken_off_within_a_step_is_recorded_without_its_last_state():
    class Breaks(Recorder):
        def step(self, env, commands):
            if env.scorer.time > 0.45:
                raise KeyboardInterrupt
            super().step(env, commands)

    recorder = Breaks("random_walk", 0)
    env = WatchedExploration("apartment", make_settings(robots=1), watchers=[recorder])
    assert run_episode(lidarium.policy("random_walk"), env, 0, raise_interrupt=False).is_interrupted
    record = recorder.finish(is_interrupted=True)
    assert (record.header["interrupted"], record.header["steps"], record.header["final_sha256"]) == (
        True,
        4,
        None,
    )


def test_a_recorder_that_saw_nothing_has_no_record():
    with pytest.raises(ValueError, match="has seen no episode"):
        Recorder().finish()


def test_versions_are_those_that_run():
    found = made_with("kinematic")
    assert (found["numpy"], found["numba"]) == (np.__version__, numba.__version__)
    assert found["machine"]
    assert "pybullet" not in found


def test_what_moves_the_bodies_is_named():
    pytest.importorskip("pybullet", reason="PyBullet is not installed")
    assert made_with("bullet")["pybullet"][0].isdigit()


@pytest.mark.parametrize("known_starts", [True, False])
def test_each_sample_is_the_map_of_its_time(known_starts):
    settings = make_settings(robots=2, resolution=0.05, known_starts=known_starts, noise="datasheet")
    env = ExplorationEnv("apartment", settings)
    env.reset(seed=1)
    generator = np.random.default_rng(2)
    sampler, wanted = MapSampler(env, 2.0), {}
    for step in range(60):
        if step % 20 == 0:
            sampler.sample()
            wanted[env.scorer.time] = three_levels(team_log_odds(env)[0])
            turns = generator.uniform(-1.0, 1.0, 2)
        env.step({agent: np.array([1.0, turn], np.float32) for agent, turn in zip(env.agents, turns, strict=True)})
    changes = sampler.changes()
    assert changes.times.tolist() == pytest.approx(list(wanted))
    for time, levels in wanted.items():
        assert np.array_equal(changes.levels_at(time), levels)
    assert (levels != wanted[0.0]).any()


def test_a_step_has_one_sample_and_a_map_that_rests_has_no_changes():
    env = ExplorationEnv("apartment", make_settings(robots=1, resolution=0.05))
    env.reset(seed=0)
    sampler = MapSampler(env, 2.0)
    sampler.sample()
    first = sampler.changes()
    assert first.times.tolist() == [0.0]
    assert first.counts[0] == len(first.places) > 0
    ascending = first.places[: first.counts[0]]
    assert (np.diff(ascending) > 0).all()
