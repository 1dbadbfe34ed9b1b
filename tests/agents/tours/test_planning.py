"""The first legs of tours past the frontiers of a map."""

import numpy as np
import pytest

from lidarium.agents.tours.planning import (
    Tourist,
    TourRequest,
    TourSettings,
    first_options,
    first_places,
    leg_to,
    memory_of,
    tour_options,
)
from lidarium.envs.onboard.navigation import NavigationMap

RESOLUTION = 0.05


def corridor():
    """Return a corridor of 12 m of which the ends are unknown."""
    log_odds = np.zeros((40, 280), np.int8)
    log_odds[10:30, 20:260] = -20
    log_odds[9, 19:261] = log_odds[30, 19:261] = 20
    navigation = NavigationMap(log_odds, RESOLUTION)
    navigation.changed((0, 40, 0, 280))
    return navigation


def corridor_with_a_door():
    """Return the corridor with a door at x = 3 m to what is unknown."""
    log_odds = corridor().log_odds.copy()
    log_odds[30, 50:70] = -20
    navigation = NavigationMap(log_odds, RESOLUTION)
    navigation.changed((0, 40, 0, 280))
    return navigation


def legs_of(navigation, robots, **settings):
    chosen = TourSettings(**settings)
    clusters = navigation.frontiers.clusters(minimum_cells=6)
    rules = chosen.rules(5.6)
    (options,) = tour_options(
        [TourRequest(navigation, clusters, robots, memory_of(navigation, chosen))], 0.18, chosen, rules
    )
    if options is None:
        return [None] * len(robots)
    firsts = first_options(options)
    return [None if k is None else leg_to(k, options, navigation, rules) for k in firsts]


def robot(x, y=1.0, heading=0.0, **kept):
    return Tourist(np.array([x, y, heading]), **kept)


def test_a_robot_goes_to_the_nearer_end():
    navigation = corridor()
    for x, is_left in ((4.0, True), (10.0, False)):
        (leg,) = legs_of(navigation, [robot(x)])
        assert (leg.frontier_cell[1] < 140) == is_left
        assert leg.gain > 1.0
        assert navigation.log_odds[leg.cell] < 0
        assert np.cos(leg.direction) * (-1 if is_left else 1) > 0.9


def test_two_robots_side_by_side_take_one_end_each():
    left, right = legs_of(corridor(), [robot(6.9), robot(7.1)])
    assert left.frontier_cell[1] < 140 < right.frontier_cell[1]


def test_a_robot_sets_out_to_the_front():
    for heading, is_left in ((0.0, False), (np.pi, True)):
        (leg,) = legs_of(corridor(), [robot(7.0, heading=heading)])
        assert (leg.frontier_cell[1] < 140) == is_left


def test_a_robot_keeps_to_what_it_drives_to():
    navigation = corridor()
    (far,) = legs_of(navigation, [robot(7.5)])
    assert far.frontier_cell[1] > 140
    kept = (20, 20)
    (leg,) = legs_of(navigation, [robot(7.5, kept_cell=kept, kept=3.0)])
    assert leg.frontier_cell[1] < 140


def test_each_robot_in_turn_has_its_nearest_frontier_on_the_tours():
    navigation = corridor_with_a_door()
    settings = TourSettings(most=2)
    clusters = navigation.frontiers.clusters(minimum_cells=6)
    assert len(clusters) == 3
    for robots, columns in (
        ([robot(2.0)], [20, 60]),
        ([robot(2.0), robot(9.0)], [20, 259]),
        ([robot(9.0), robot(2.0)], [20, 259]),
    ):
        request = TourRequest(navigation, clusters, robots, memory_of(navigation, settings))
        (options,) = tour_options([request], 0.18, settings, settings.rules(5.6))
        found = [float(options.cells_of(k)[:, 1].mean()) for k in range(len(options.numbers))]
        np.testing.assert_allclose(found, columns, atol=10.0)
        # The nearest to any robot comes first.
        assert (np.diff(options.lengths.min(axis=0)) >= 0.0).all()


def test_frontiers_that_show_little_are_left_to_the_end():
    assert legs_of(corridor(), [robot(4.0)], least_gain=100.0) == [None]


def test_robots_without_a_frontier_stay():
    legs = legs_of(corridor(), [robot(6.0), robot(7.0), robot(8.0)])
    assert sum(leg is None for leg in legs) == 1


def test_first_places_are_those_behind_each_separator():
    assert first_places(np.array([2, 0, 4, 1, 3]), 4) == [2, 1]
    assert first_places(np.array([3, 1, 0, 4, 2]), 3) == [None, 1, 2]
    assert first_places(np.array([0, 1]), 0) == [None, None, None]


def test_nothing_counts_that_lies_beyond_the_laser():
    settings = TourSettings(reach=3.0, around=0.8, depth=1.2)
    assert settings.rules(2.0).reach == 2.0
    assert settings.rules(9.0).reach == 3.0
    assert (settings.rules(9.0).around, settings.rules(9.0).depth) == (0.8, 1.2)


def test_the_longest_tour_counts_one_and_the_rest_is_weighed_against_it():
    assert tuple(TourSettings(total=0.3, waiting=0.2).weights) == (1.0, 0.3, 0.2)


@pytest.mark.parametrize(("name", "value"), [("most", 0), ("kept_share", 1.5), ("reach", 0.0), ("kept", -1.0)])
def test_settings_that_make_no_sense_are_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} of tours is"):
        TourSettings(**{name: value})
