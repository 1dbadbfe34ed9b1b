"""Which way a robot chooses next."""

import math
from dataclasses import replace

import numpy as np
from srt_halls import LIMITS, RADIUS, hall, senses_at

from lidarium.agents.srt.candidates import Candidate, CandidateSource
from lidarium.agents.srt.choice import WayChooser
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
