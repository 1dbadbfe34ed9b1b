"""Tour frontier in whole episodes."""

import numpy as np
import pytest

import lidarium
from lidarium.agents import PerRobot
from lidarium.agents.tours.policy import TourFrontier
from lidarium.envs.floors.floor import Floor, Solid
from lidarium.evaluation.episodes.runner import run_episode


def wall(x, y, width, height):
    return Solid(np.array([[x, y], [x + width, y], [x + width, y + height], [x, y + height]]))


def finished(policy, floor, **settings):
    chosen = {"resolution": 0.05, "map_cells": 32, "horizon_s": 900.0, "stop_coverage": 0.99, **settings}
    env = lidarium.parallel_env(floor, **chosen, starts="fixed")
    return run_episode(policy, env, 0)


def test_it_needs_less_time_than_the_nearest_frontier():
    for robots in (1, 2):
        ours = finished(TourFrontier(), "building:4", robots=robots).env.scorer
        nearest = finished(lidarium.policy("nearest_frontier"), "building:4", robots=robots).env.scorer
        assert ours.coverage >= 0.99
        assert ours.time < 0.95 * nearest.time


def test_a_robot_that_sees_to_the_front_alone_turns_to_what_it_came_for():
    floor = Floor(
        "two_rooms",
        (0.0, 0.0, 7.0, 4.5),
        (wall(3.4, 0.0, 0.2, 1.6), wall(3.4, 2.6, 0.2, 1.9)),
        starts=np.array([[1.0, 1.0, 0.5]]),
    )
    lidar = {"beams": 91, "field_of_view": 1.2, "range_max": 4.0}
    assert finished(TourFrontier(), floor, lidar=lidar).env.scorer.coverage >= 0.99


@pytest.mark.parametrize("radio", ["all", "range"])
def test_robots_that_hear_each_other_now_and_then_finish_together(radio):
    episode = finished(TourFrontier(), "building:4", robots=3, radio=radio)
    assert episode.env.scorer.coverage >= 0.99
    assert episode.env.world.collisions.sum() == 0


def test_what_is_left_at_the_end_is_named():
    episode = finished(TourFrontier(), "apartment", stop_coverage=None, horizon_s=None)
    assert set(episode.env.scorer.ended_because.values()) <= {"no_frontier", "frontier_unreachable"}
    assert episode.env.scorer.coverage >= 0.995
    assert all(entry.reason for entry in episode.given_up)


def test_unknown_settings_and_values_out_of_bounds_are_refused():
    with pytest.raises(ValueError, match=r"setting of tours 'hurry'.*known: minimum_size"):
        TourFrontier(hurry=1.0)
    with pytest.raises(ValueError, match=r"'turn_lenght'; did you mean 'turn_length'"):
        TourFrontier(turn_lenght=1.0)
    with pytest.raises(ValueError, match="kept_share"):
        TourFrontier(kept_share=2.0)


def test_a_policy_may_decide_more_often_than_the_settings_say():
    policy = TourFrontier()
    episode = finished(policy, "apartment", horizon_s=20.0)
    assert len(episode.decision_seconds) >= 20.0 / policy.decision_period_s - 1


def test_it_counts_what_sent_its_robots():
    policy = TourFrontier()
    finished(policy, "apartment", stop_coverage=None, horizon_s=None)
    counts = policy.report().decided_by
    assert set(counts) == {"tours", "nearest"}  # the last specks are no stops of tours
    assert counts["tours"] > counts["nearest"] > 0
    finished(policy, "apartment", stop_coverage=None, horizon_s=10.0)
    assert set(policy.report().decided_by) == {"tours"}
    without = TourFrontier(least_gain=1e6)
    finished(without, "apartment", robots=2)
    assert set(without.report().decided_by) == {"nearest"}


def test_its_part_of_supervised_and_of_each_robot_alone_is_counted():
    alone = PerRobot(TourFrontier)
    finished(alone, "apartment", robots=2)
    led = lidarium.policy("supervised_tours")
    finished(led, "apartment", robots=2, known_starts=False, horizon_s=60.0)
    for policy in (alone, led):
        assert policy.report().decided_by["tours"] >= 2
