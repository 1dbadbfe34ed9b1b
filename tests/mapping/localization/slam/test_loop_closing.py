"""Closures act once, some time after they were found."""

import math
from dataclasses import replace

import numpy as np
import pytest
from driven_rooms import GEOMETRY, cast, odd_room
from mapped_room import ORIGIN, odd_room_submap

from lidarium.mapping.geometry.rigid import composed
from lidarium.mapping.localization.graph.node_graph import NodeGraph
from lidarium.mapping.localization.matching.local_mapping import Finished
from lidarium.mapping.localization.matching.scan_points import scan_points
from lidarium.mapping.localization.matching.settings.graph import ClosureSettings
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.slam.loop_closing import LoopClosing

# It tells at once what it recognises, however far that would move the robot.
SETTINGS = SlamSettings(closures=ClosureSettings(delay_s=2.0, confirmed_beyond_m=1.0))
TRUE, BELIEVED = np.array([0.1, 0.05, 0.02]), np.array([0.2, -0.05, 0.05])


def back_again(settings=SETTINGS):
    """Loops that know the room from long ago, the nodes of a robot that comes back, and what it sees."""
    loops = LoopClosing(settings)
    loops.remember([Finished(odd_room_submap().finished(), np.array([0]), np.zeros((1, 3)))], 0.0)
    graph = NodeGraph(settings.graph, None, np.zeros(3))
    graph.add(BELIEVED, np.diag([0.3**2, 0.3**2, math.radians(5.0) ** 2]))
    points = scan_points(
        cast(odd_room(), composed(ORIGIN, TRUE)),
        GEOMETRY.unit_vectors,
        GEOMETRY.angle_increment,
        5.6,
        0.05,
        350,
    )
    return loops, graph, points


def test_a_place_is_recognised_and_acts_once_after_the_delay():
    loops, graph, points = back_again()
    loops.find(graph, points, 50.0, 0.6, 10.0)
    assert loops.pending == 1
    assert loops.take_due(11.9) == []
    (closure,) = loops.take_due(12.0)
    assert (closure.old, closure.new) == (0, 1)
    assert closure.measured == pytest.approx(TRUE, abs=0.02)
    assert loops.pending == 0
    assert loops.take_due(99.0) == []


def test_each_closure_waits_for_its_own_time():
    loops, graph, points = back_again()
    for now in (10.0, 10.5):
        loops.find(graph, points, 50.0, 0.6, now)
    assert len(loops.take_due(12.2)) == 1
    assert loops.pending == 1
    assert len(loops.take_due(math.inf)) == 1


def test_a_local_map_of_short_ago_recognises_nothing():
    loops, graph, points = back_again()
    loops.find(graph, points, SETTINGS.closures.path_m - 0.1, 0.6, 10.0)
    assert loops.pending == 0


def test_places_are_not_recognised_where_no_candidate_is_tried():
    loops, graph, points = back_again(replace(SETTINGS, closures=replace(SETTINGS.closures, candidates=0)))
    loops.find(graph, points, 50.0, 0.6, 10.0)
    assert loops.pending == 0
