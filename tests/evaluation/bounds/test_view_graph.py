"""A floor as places, the paths between them, and what is seen from each."""

import math
from dataclasses import replace

import numpy as np
import pytest
from linked_places import STAR
from linked_places import graph_of as star_of
from linked_rooms import ROOM, TWO_ROOMS, settings_of

from lidarium.evaluation.bounds.bound import graph_of
from lidarium.evaluation.bounds.view_graph import (
    bits_of,
    count,
    numbers_of,
    reached,
    seen_on_track,
    view_graph,
)
from lidarium.mapping.grids.grid_lines import visible


def test_views_are_what_lines_of_sight_reach():
    settings = settings_of()
    graph = graph_of(TWO_ROOMS, settings, TWO_ROOMS.starts[:1])
    levels = np.where(graph.laser.solid > 0, 1, -1).astype(np.int8)
    for place in (0, len(graph.places) // 2):
        cell = np.floor((graph.places[place] - graph.laser.origin) / graph.laser.resolution)[::-1]
        reach = settings.lidar.range_max / graph.laser.resolution
        wanted = visible(levels, (int(cell[0]), int(cell[1])), graph.points, reach)
        assert np.array_equal(numbers_of(graph.views[place]), np.flatnonzero(wanted))


def test_bits_and_numbers_are_the_same():
    numbers = np.array([0, 5, 63, 64, 130])
    bits = bits_of(numbers, 3)
    assert np.array_equal(numbers_of(bits), numbers)
    assert count(bits) == 5


def test_a_path_names_the_places_that_it_passes():
    graph = star_of(STAR, [[2], [4, 6]])
    assert graph.path(2, 6) == [1, 0, 5, 6]
    assert graph.path(3, 3) == []
    assert numbers_of(graph.seen([2, 4])).tolist() == [0, 1]


def test_places_that_no_start_is_joined_to_are_not_reached():
    graph = star_of([(0, 1, 1.0), (2, 3, 1.0)], [[1]])
    assert reached(graph).tolist() == [True, True, False, False]


def test_a_robot_sees_in_its_field_of_view_only():
    settings = settings_of()
    graph = graph_of(ROOM, settings, ROOM.starts)
    xy = (graph.points[:, ::-1] + 0.5) * graph.laser.resolution + np.asarray(graph.laser.origin)
    looks_along_y = np.array([[*graph.places[0], 0.5 * math.pi]])
    half = numbers_of(seen_on_track(graph, looks_along_y, 10.0, math.pi / 2))
    whole = numbers_of(seen_on_track(graph, looks_along_y, 10.0, 2.0 * math.pi))
    assert len(whole) == len(graph.points)
    away = xy - graph.places[0]
    wanted = np.abs(np.arctan2(away[:, 0], away[:, 1])) <= math.pi / 4
    on_edge = np.abs(np.abs(away[:, 0]) - away[:, 1]) < 0.1
    found = np.isin(np.arange(len(xy)), half)
    assert np.array_equal(found[~on_edge], wanted[~on_edge])


def test_two_frames_are_refused():
    graph = graph_of(ROOM, settings_of(), ROOM.starts)
    with pytest.raises(ValueError, match="different frames"):
        view_graph(replace(graph.laser, origin=(1.0, 0.0)), graph.laser, 0.17, 3.5, ROOM.starts)
