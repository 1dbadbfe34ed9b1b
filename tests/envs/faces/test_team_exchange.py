"""The robots of an episode exchange their maps: when, among whom, and what comes of it."""

import math

import numpy as np
import pytest

import lidarium
from lidarium.envs.faces.team_exchange import (
    MergeEvent,
    MergingSettings,
    TeamExchange,
    frames_of,
    partners,
    team_boxes,
)
from lidarium.envs.floors.floor import Floor
from lidarium.mapping.grids.occupancy import UNKNOWN

STARTS = np.array([[1.0, 1.0, 0.0], [3.0, 2.0, math.pi / 2], [4.0, 1.0, 1.0]])
HALL = Floor("hall", (0.0, 0.0, 5.0, 4.0))
KNOWN = MergingSettings(period_s=0.5, known_starts=True)


def team(robots=2, **options):
    options = {"known_starts": False, "map_cells": 32, "resolution": 0.05, **options}
    env = lidarium.parallel_env(HALL, robots=robots, **{"starts": "fixed", **options})
    env.reset(seed=0, options={"starts": STARTS[:robots]})
    return env


def step(env, steps):
    for _ in range(steps):
        env.step({agent: [0.0, 0.0] for agent in env.agents})


def test_maps_are_exchanged_at_whole_periods():
    env = team()
    exchange = TeamExchange(env.perception, KNOWN)
    times = []
    for _ in range(13):
        exchange.exchange()
        times.append(exchange.team.received["robot_0", "robot_1"].time_s)
        step(env, 1)
    assert times == pytest.approx([0.0] * 5 + [0.5] * 5 + [1.0] * 3)


def test_an_event_is_noted_when_two_robots_are_joined_and_again_after_they_parted():
    env = team()
    exchange = TeamExchange(env.perception, KNOWN, lambda time_s, poses: np.full((2, 2), time_s != 0.5))
    events = []
    for _ in range(4):
        events.append(exchange.exchange())
        step(env, 5)
    assert [len(joined) for joined in events] == [1, 0, 1, 0]
    assert exchange.events == [*events[0], *events[2]]
    first = exchange.events[0]
    assert (first.a, first.b, first.time_s) == ("robot_0", "robot_1", 0.0)
    # The second robot, a quarter turned, in the frame of the first.
    assert first.true == pytest.approx((2.0, 1.0, math.pi / 2))
    assert first.found == first.true
    assert exchange.events[1].time_s == pytest.approx(1.0)
    exchange.start()
    assert exchange.events == []
    assert exchange.team.received == {}


@pytest.mark.parametrize("known_starts", [True, False])
def test_frames_are_those_of_the_starts(known_starts):
    env = team(3, known_starts=known_starts)
    frames = frames_of(env.perception, 0)
    assert len(frames) == 6
    found = frames["robot_0", "robot_1"]
    theta = 0.0 if known_starts else math.pi / 2
    assert (found.x, found.y, found.theta) == pytest.approx((2.0, 1.0, theta), abs=1e-9)
    around = frames["robot_0", "robot_1"] @ frames["robot_1", "robot_2"] @ frames["robot_2", "robot_0"]
    assert (around.x, around.y, around.theta) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_robots_reach_each_other_through_others_or_by_radio():
    links = np.array([[1, 0, 0], [1, 1, 0], [0, 1, 1]], bool)
    env = team(3)
    chained = TeamExchange(env.perception, KNOWN, links)
    assert len(chained.exchange()) == 3
    silent = team(3, radio="none")
    assert TeamExchange(silent.perception, KNOWN).exchange() == []
    assert len(TeamExchange(team(3).perception, KNOWN).exchange()) == 3


def test_what_is_observed_is_the_map_of_the_team_and_where_teammates_were():
    env = team(3)
    exchange = TeamExchange(env.perception, KNOWN, np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]], bool))
    exchange.exchange()
    step(env, 2)
    observed, boxes = exchange.observed(0), team_boxes(3, 32)
    for name, box in boxes.items():
        assert box.contains(observed[name]), name
    assert (observed["team_map"] != UNKNOWN).any()
    first, second = observed["teammates"]
    assert first == pytest.approx([2.0, 1.0, math.pi / 2, 0.2, 1.0], abs=1e-5)
    assert not second.any()


def test_partners_are_named_in_the_order_of_events():
    pose = (0.0, 0.0, 0.0)
    events = [MergeEvent(1.0, a, b, pose, pose, (0.0, 0.0)) for a, b in (("a", "b"), ("b", "c"), ("a", "c"))]
    assert partners(events, "a") == ["b", "c"]
    assert partners(events, "b") == ["a", "c"]
    assert partners(events, "d") == []


def test_teams_and_links_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match="robots is 1; merging maps wants two or more"):
        TeamExchange(team(1).perception, KNOWN)
    with pytest.raises(ValueError, match=r"can_talk has shape \(3, 3\); want \(2, 2\)"):
        TeamExchange(team().perception, KNOWN, np.ones((3, 3), bool))
    with pytest.raises(ValueError, match="period_s"):
        MergingSettings(period_s=0.0)
