"""Metrics over time."""

import numpy as np
import pytest
from seen_truth import NEAR, begun

import lidarium
from lidarium.envs.faces.parallel import ExplorationEnv
from lidarium.envs.floors.floor import Floor, Raster
from lidarium.envs.settings.making import make_settings
from lidarium.envs.simulation.coverage import unpack_bits
from lidarium.envs.simulation.kernels.arrays import ENDED
from lidarium.evaluation.episodes.history import Footprints, History
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration, Watcher
from lidarium.evaluation.metrics import cells
from lidarium.evaluation.truth.beliefs import free_as_held, maps_on_floor
from lidarium.evaluation.truth.true_map import truth_of


class Whole(Watcher):
    """Works out the figures from whole maps and masks at every period. A watcher."""

    def begin(self, env):
        self.rows, self.steps = [], 0
        self._note(env)

    def step(self, env, commands):
        self.steps += 1
        if self.steps % env.settings.decision_steps == 0:
            self._note(env)

    def outcome(self, env):
        pass

    def _note(self, env):
        truth, maps = truth_of(env), maps_on_floor(env)
        known, held = (maps != 0).any(axis=0), free_as_held(env, maps)
        self.rows.append(
            (
                env.scorer.time,
                cells.free_coverage(unpack_bits(env.score.team_masks[0], known.shape[1]), truth.counted),
                cells.known_coverage(known, truth.knowable),
                cells.valid_coverage(known, truth.counted, truth.occupied),
                *(cells.free_coverage(own, truth.counted) for own in held),
            )
        )


def watched(*others, policy="nearest_frontier", floor="apartment", **options):
    history = History()
    settings = make_settings(**{"robots": 3, "resolution": 0.05, "horizon_s": 40.0, **options})
    env = WatchedExploration(floor, settings, watchers=[history, *others])
    return run_episode(lidarium.policy(policy), env, 0), history


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"noise": "thesis"},
        {"known_starts": False, "noise": "datasheet", "horizon_s": 20.0},
        {"robots": 1, "policy": "random_walk"},
        {"resolution": 0.1, "observe": ("scan", "pose", "egocentric_map")},
    ],
)
def test_curves_are_those_of_whole_maps(options):
    whole = Whole()
    _, history = watched(whole, **options)
    curves = history.curves
    sampled = np.column_stack([curves.times, curves.c_free, curves.c_known, curves.c_valid, curves.c_own])
    assert len(whole.rows) > 10
    np.testing.assert_allclose(sampled[: len(whole.rows)], whole.rows, rtol=0.0, atol=1e-12)


def test_a_sample_is_taken_at_the_start_every_decision_period_and_at_the_end():
    episode, history = watched(stop_coverage=0.8)
    curves = history.curves
    assert curves.times[0] == 0.0
    assert np.allclose(np.diff(curves.times)[:-1], 2.0)
    assert curves.times[-1] == episode.env.scorer.time
    assert curves.c_free[-1] == episode.env.scorer.coverage
    assert np.array_equal(curves.lengths[-1], episode.env.world.travelled)
    assert len(curves.seen_once) == len([time for time in curves.times if abs(time / 2.0 - round(time / 2.0)) < 1e-9])


def test_thresholds_are_noted_in_the_step_that_reaches_them():
    episode, history = watched(horizon_s=90.0)
    times = episode.env.scorer.times
    assert {milestone.time_s for milestone in history.milestones} == set(times.values())
    for share, time in times.items():
        milestone = history.milestone(share)
        assert milestone.time_s == time
        assert milestone.coverage >= share
        assert 0 < milestone.decisions <= len(episode.decision_seconds)
    lengths = np.array([milestone.lengths for milestone in history.milestones])
    assert (np.diff(lengths, axis=0) >= 0.0).all()


@pytest.mark.parametrize("known_starts", [True, False])
def test_the_last_milestone_has_what_each_map_knew(known_starts):
    room = np.ones((30, 30), np.uint8)
    room[1:-1, 1:-1] = 0
    floor = Floor("room", (0.0, 0.0, 3.0, 3.0), cells=Raster(room, (0.0, 0.0), 0.1))
    episode, history = watched(floor=floor, robots=2, known_starts=known_starts)
    truth, maps = truth_of(episode.env), maps_on_floor(episode.env)
    milestone = history.milestone(0.99)
    assert milestone.time_s == episode.env.scorer.time
    assert milestone.known_shares == pytest.approx([cells.known_coverage(own != 0, truth.knowable) for own in maps])
    assert milestone.overlap == cells.overlap(episode.env.score.masks)


def test_a_lone_robot_overlaps_with_nobody():
    _, history = watched(robots=1, horizon_s=10.0)
    assert not history.curves.seen_twice.any()


def test_robots_in_one_room_see_much_of_the_same():
    history = History()
    env = WatchedExploration(
        "apartment", make_settings(robots=2, resolution=0.05, lidar="lidar_360_6m"), watchers=[history]
    )
    env.reset(seed=0, options={"starts": np.array([(2.5, 4.0, 0.0), (2.5, 4.4, 0.0)])})
    [once], [twice] = history.curves.seen_once, history.curves.seen_twice
    assert 0.3 * once < twice < once


def test_looking_on_changes_nothing():
    episode, _ = watched(noise="datasheet")
    alone = ExplorationEnv("apartment", episode.env.settings)
    run_episode(lidarium.policy("nearest_frontier"), alone, 0)
    np.testing.assert_array_equal(episode.env.world.poses, alone.world.poses)
    np.testing.assert_array_equal(episode.env.simulation.ranges, alone.simulation.ranges)
    np.testing.assert_array_equal(episode.env.beliefs.log_odds, alone.beliefs.log_odds)


def test_a_new_episode_is_a_new_history():
    episode, history = watched(horizon_s=6.0)
    run_episode(lidarium.policy("nearest_frontier"), episode.env, 1)
    assert np.allclose(history.curves.times, [0.0, 2.0, 4.0, 6.0])
    assert len(history.believed) == len(episode.env.scorer.track)


def counts_of(masks):
    sums = np.sum([np.unpackbits(mask.view(np.uint8)) for mask in masks], axis=0, dtype=np.int64)
    return int((sums >= 1).sum()), int((sums >= 2).sum())


@pytest.mark.parametrize("starts", [NEAR, [*NEAR, (3.0, 4.3, 3.0)], [*NEAR, NEAR[0] + (0.6, 0.0, 0.0)]])
def test_cells_are_counted_that_one_and_that_two_see(starts):
    env = begun(starts)
    footprints = Footprints(env)
    wanted = counts_of(env.score.masks)
    assert wanted[1] > 0
    assert footprints.count(env) == footprints.count(env) == wanted


def test_robots_whose_footprints_cannot_meet_count_nothing():
    env = begun([(2.5, 4.0, 0.0), (8.4, 6.3, 0.0)])
    env.world.poses[1, 0] += 2.0 * env.settings.lidar.range_max
    assert Footprints(env).count(env) == (0, 0)


def test_who_has_ended_sees_nothing():
    env = begun([*NEAR, (3.0, 4.3, 3.0)])
    env.world.flags[2] |= ENDED
    assert Footprints(env).count(env) == counts_of(env.score.masks[:2])
