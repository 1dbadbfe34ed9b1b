"""Decisions of robots in a corridor of which both ends are unknown."""

import numpy as np
import pytest

from lidarium.agents.learned.decision import _tours_in, decision_of, scene_of
from lidarium.agents.learned.features import OPTION_FEATURES, SITUATION_FEATURES, TEAMMATE_FEATURES
from lidarium.agents.tours.planning import (
    Tourist,
    TourRequest,
    TourSettings,
    first_options,
    memory_of,
    tour_options,
)
from lidarium.envs.onboard.navigation import NavigationMap
from lidarium.mapping.planning.touring.tours import with_first

RESOLUTION = 0.05
PROGRESS = {"time": 30.0, "known": 20.0, "rate": 0.5}


def corridor(row=60, column=100):
    """Return a corridor of 12 m whose lower left corner is at a cell, both ends unknown."""
    log_odds = np.zeros((200, 600), np.int8)
    log_odds[row : row + 20, column : column + 240] = -20
    log_odds[row - 1, column : column + 240] = log_odds[row + 20, column : column + 240] = 20
    navigation = NavigationMap(log_odds, RESOLUTION)
    navigation.changed((0, 200, 0, 600))
    return navigation


def scene_in(navigation, robots):
    settings = TourSettings()
    clusters = navigation.frontiers.clusters(minimum_cells=6)
    request = TourRequest(navigation, clusters, robots, memory_of(navigation, settings))
    (options,) = tour_options([request], 0.18, settings, settings.rules(5.6))
    return scene_of(options, navigation, 5.6, settings.weights, PROGRESS)


def at(x, y=0.5, heading=0.0, corner=(60, 100), **kept):
    """Return a robot so far from the lower left corner of the corridor."""
    return Tourist(np.array([x + corner[1] * RESOLUTION, y + corner[0] * RESOLUTION, heading]), **kept)


def column(decision, name):
    return decision.options[:, list(OPTION_FEATURES).index(name)] * OPTION_FEATURES[name]


def test_features_say_how_options_lie():
    scene = scene_in(corridor(), [at(3.0)])
    decision = decision_of(scene, 0, scene.options.sequence, [])
    assert len(decision.scores) == 2
    ahead, path = column(decision, "ahead"), column(decision, "path")
    near, far = int(np.argmin(path)), int(np.argmax(path))
    assert decision.classic == near == first_options(scene.options)[0]
    assert ahead[near] < 0.0 < ahead[far]
    assert path == pytest.approx(np.abs(ahead), abs=1.0)
    assert column(decision, "cosine")[far] == pytest.approx(1.0, abs=0.02)
    assert column(decision, "gain_ahead") == pytest.approx(1.0, abs=0.1)
    assert column(decision, "is_first")[near] == 1.0
    assert set(column(decision, "place").round(3)) == {1.0, 2.0}
    assert column(decision, "size") == pytest.approx(1.0, abs=0.2)
    assert (column(decision, "far_gain") > column(decision, "gain")).all()
    assert decision.scores[near] == 0.0
    assert decision.scores[far] < -1.0
    assert decision.mask.all()
    situation = dict(zip(SITUATION_FEATURES, decision.situation, strict=True))
    assert situation["time"] == pytest.approx(0.1)
    assert situation["options"] == pytest.approx(0.2)
    assert situation["own_tour"] * 50.0 == pytest.approx(2.0 + 10.5, abs=1.5)


def test_no_feature_says_where_on_the_floor_a_robot_is():
    first = scene_in(corridor(), [at(3.0), at(8.0, heading=1.0)])
    corner = (100, 220)
    moved = scene_in(corridor(*corner), [at(3.0, corner=corner), at(8.0, heading=1.0, corner=corner)])
    for robot in range(2):
        one = decision_of(first, robot, first.options.sequence, [None] * robot)
        other = decision_of(moved, robot, moved.options.sequence, [None] * robot)
        np.testing.assert_allclose(one.options, other.options, atol=1e-5)
        np.testing.assert_array_equal(one.crops, other.crops)
        np.testing.assert_allclose(one.teammates, other.teammates, atol=1e-5)
        np.testing.assert_allclose(one.situation, other.situation, atol=1e-5)


def test_what_was_picked_just_before_is_not_on_offer():
    scene = scene_in(corridor(), [at(3.0), at(4.0)])
    begin = decision_of(scene, 0, scene.options.sequence, [])
    other = 1 - begin.classic
    sequence = with_first(scene.options.sequence, 0, other, 2)
    second = decision_of(scene, 1, sequence, [other])
    if second is not None:
        assert not second.mask[other]
        names = list(TEAMMATE_FEATURES)
        assert second.teammates[0, names.index("has_picked")] == 1.0
        assert second.teammates[0, names.index("has_target")] == 1.0


def test_a_robot_without_a_tour_has_nothing_to_decide():
    scene = scene_in(corridor(), [at(3.0), at(6.0), at(9.0)])
    tours = _tours_in(scene.options.sequence, 2)
    idle = [robot for robot, tour in enumerate(tours) if not tour]
    assert idle
    for robot in idle:
        assert decision_of(scene, robot, scene.options.sequence, []) is None


def test_teammates_are_seen_in_the_robots_frame():
    scene = scene_in(corridor(), [at(3.0, heading=np.pi / 2), at(5.0, kept_cell=(70, 335))])
    decision = decision_of(scene, 0, scene.options.sequence, [])
    names = list(TEAMMATE_FEATURES)
    other = {name: decision.teammates[0, k] * TEAMMATE_FEATURES[name] for k, name in enumerate(names)}
    assert other["ahead"] == pytest.approx(0.0, abs=1e-5)
    assert other["left"] == pytest.approx(-2.0, abs=1e-5)
    assert other["sine"] == pytest.approx(-1.0, abs=1e-5)
    assert other["has_target"] == 1.0
    assert other["target_left"] < -5.0
    assert other["has_picked"] == 0.0
