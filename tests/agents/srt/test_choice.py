"""Which way a robot chooses next."""

import math
from dataclasses import replace

import numpy as np
import pytest
from srt_halls import LIMITS, RADIUS, RESOLUTION, hall, senses_at

from lidarium.agents.intent import Intent
from lidarium.agents.srt.candidates import Candidate, CandidateSource
from lidarium.agents.srt.choice import WayChooser, _first_on_tour
from lidarium.agents.srt.memories import RegionMemory
from lidarium.agents.srt.safe_region import DIRECTIONS, safe_region, seen_region
from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.srt.tree import Node, Tree


def went_for(memory, goal, targets=()):
    """Return the x that a robot at (4, 2) goes for, whose only node shows walls all round."""
    srt, there = SrtSettings(), senses_at(4.0, 2.0, math.pi / 2)
    there = replace(there, goal=None if goal is None else np.array(goal) + 1.0)
    place, view = there.pose[:2], np.ones(DIRECTIONS)
    safe = safe_region(place, view, 0.0, "radial", RADIUS, 4.0)
    node = Node(0, "robot_0", there.pose, safe, seen_region(place, view, 4.0), [], None, view)
    tree = Tree()
    tree.add(node, None, set())
    source = CandidateSource(srt, RADIUS, np.random.default_rng(0))
    chooser = WayChooser(source, srt, LIMITS, np.random.default_rng(0))
    way = chooser.choose(node, tree, {0}, memory, there, targets)
    return float(way[-1].candidate.focus[0]) - 1.0


def test_towards_a_goal_a_robot_goes_to_the_frontier_from_which_least_is_left():
    """The nearest one may lie on the wrong side."""
    memory = hall([(2.5, 3.5), (6.0, 7.0), (10.5, 11.5)])
    assert went_for(memory, None) < 4.0
    assert 6.0 <= went_for(memory, (8.0, 10.0)) <= 7.0
    assert went_for(memory, (11.0, 4.5)) > 10.0
    assert went_for(memory, (0.0, 10.0)) < 4.0


def test_towards_a_goal_what_a_teammate_goes_for_is_left_to_it():
    memory = hall([(2.5, 3.5), (10.5, 11.5)])
    teammate = Candidate(0, np.array([12.0, 4.0]), None, np.array([12.0, 5.0]), is_frontier=True)
    assert went_for(memory, (11.0, 8.0), [teammate]) < 4.0


def x_of(found):
    return float(found[1][0]) - 1.0


def test_a_robot_begins_with_the_end_from_which_it_need_not_come_back():
    memory = hall([(1.0, 2.0), (5.0, 6.0), (10.0, 11.0)])
    found = _first_on_tour(memory, senses_at(3.8, 2.0, math.pi / 2), LIMITS, 0.8, Intent(), ())
    assert 1.0 <= x_of(found) <= 2.0
    legs, focus = found
    assert math.dist(legs[-1], focus) < RADIUS + 4.0 * RESOLUTION


def test_what_it_went_for_is_left_only_for_a_gain():
    memory = hall([(3.0, 4.0), (7.9, 8.9)])
    there = senses_at(5.95, 2.0, math.pi / 2)
    left, right = (_first_on_tour(memory, there, LIMITS, 0.8, on_the_way_to([x + 1.0, 5.0]), ()) for x in (3.5, 8.4))
    assert x_of(left) < 5.0 < x_of(right)


def on_the_way_to(*places):
    """Return the intent of a robot that went for places one after the other."""
    intent = Intent()
    for place in places:
        intent.go_for(np.array(place))
    return intent


def test_a_robot_that_came_back_to_what_it_had_left_holds_on_to_it():
    """Two targets that each look better on the way to the other must not keep it between them."""
    west, east = [4.0, 5.0], [9.9, 5.0]
    assert [
        on_the_way_to(*places).kept for places in ([west], [west, east], [west, east, west], [west, east, west, east])
    ] == [
        1.0,
        1.0,
        2.0,
        4.0,
    ]
    assert on_the_way_to(west, [4.2, 5.0], west).kept == 1.0
    settled = on_the_way_to(west, east, west)
    settled.settle()
    assert (settled.kept, settled.latest.tolist()) == (1.0, west)
    memory, there = hall([(2.5, 3.5), (7.9, 8.9)]), senses_at(7.0, 2.0, math.pi / 2)
    assert x_of(_first_on_tour(memory, there, LIMITS, 0.8, on_the_way_to(west), ())) > 5.0
    assert x_of(_first_on_tour(memory, there, LIMITS, 0.8, on_the_way_to(west, east, west, east, west), ())) < 5.0


def test_a_long_frontier_makes_up_for_a_longer_way():
    there = senses_at(6.0, 2.0, math.pi / 2)
    assert x_of(_first_on_tour(hall([(2.8, 3.8), (8.1, 9.1)]), there, LIMITS, 0.8, Intent(), ())) > 6.0
    assert x_of(_first_on_tour(hall([(0.8, 3.8), (8.1, 9.1)]), there, LIMITS, 0.8, Intent(), ())) < 6.0


def test_what_a_teammate_goes_for_is_left_to_it_and_frontiers_near_by_cost_more():
    memory, there = hall([(3.0, 4.0), (8.0, 9.0)]), senses_at(5.0, 2.0, math.pi / 2)
    assert x_of(_first_on_tour(memory, there, LIMITS, 0.8, Intent(), ())) < 5.0
    assert x_of(_first_on_tour(memory, there, LIMITS, 0.8, Intent(), [np.array([4.5, 5.0])])) > 5.0
    both = [np.array([4.5, 5.0]), np.array([9.5, 5.0])]
    assert _first_on_tour(hall([(3.4, 4.2), (8.0, 9.0)]), there, LIMITS, 0.8, Intent(), both) is None


@pytest.mark.parametrize("remembered", [lambda: hall([]), lambda: hall([(3.0, 3.5)]), lambda: RegionMemory([])])
def test_there_is_no_tour_without_frontiers_of_that_length(remembered):
    assert _first_on_tour(remembered(), senses_at(5.0, 2.0), LIMITS, 0.8, Intent(), ()) is None
