"""Searches against scipy's Dijkstra over an explicit graph, and paths against what a disc touches."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from searched_beliefs import RESOLUTION, SEEDS, made, open_start, oracle, random_belief
from smoothed_paths import shortened

from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import Until, cells_of, centres_of, plan, search
from lidarium.mapping.planning.search.path_search import SearchSpace


@settings(max_examples=40)
@given(seed=SEEDS, radius=st.sampled_from([0.0, 0.03, 0.05, 0.0625]), penalty=st.sampled_from([0.0, 3.0, 40.0]))
def test_costs_are_those_of_dijkstra_over_the_explicit_graph(seed, radius, penalty):
    footprint = Footprint(radius, radius + 0.1, penalty)
    belief = random_belief(seed)
    start = open_start(belief, footprint, seed)
    if start is None:
        return
    space, field = made(belief)
    expected, _ = oracle(belief, footprint, start)
    found = search(space, belief, field, start, footprint).costs()
    np.testing.assert_array_equal(np.isinf(found), np.isinf(expected))
    reached = np.isfinite(expected)
    np.testing.assert_allclose(found[reached], expected[reached], rtol=3e-4)  # whole units of cost


@settings(max_examples=40)
@given(seed=SEEDS, penalty=st.sampled_from([0.0, 3.0, 40.0]))
def test_a_star_and_the_search_for_a_goal_cost_what_the_full_search_does(seed, penalty):
    footprint = Footprint(0.05, 0.15, penalty)
    belief = random_belief(seed, shape=(60, 70), walls=12)
    start, goal = open_start(belief, footprint, seed), open_start(belief, footprint, seed + 1)
    if start is None:
        return
    space, field = made(belief)
    full = search(space, belief, field, start, footprint).cost(goal)
    towards = search(space, belief, field, start, footprint, until=Until(goal=goal)).cost(goal)
    guided = plan(space, belief, field, start, goal, footprint)
    assert towards == full
    assert (math.inf if guided is None else guided[0]) == full


@settings(max_examples=40)
@given(seed=SEEDS)
def test_a_path_costs_what_was_said_and_a_disc_driven_along_it_touches_nothing(seed):
    footprint = Footprint(0.0625, 0.15, 3.0)
    belief = random_belief(seed, shape=(60, 70), walls=14)
    start, goal = open_start(belief, footprint, seed), open_start(belief, footprint, seed + 1)
    if start is None:
        return
    space, field = made(belief)
    found = search(space, belief, field, start, footprint)
    if math.isinf(found.cost(goal)):
        with pytest.raises(ValueError, match="not reached"):
            found.path(goal)
        return
    path = found.path(goal)
    assert tuple(path[0]) == start
    assert tuple(path[-1]) == goal
    assert (belief[path[:, 0], path[:, 1]] < 0).all()
    assert (np.abs(np.diff(path, axis=0)).max(axis=1, initial=0) == 1).all()
    assert found.cost(goal) >= np.hypot(*np.diff(path, axis=0).T).sum() * RESOLUTION * (1 - 1e-6)
    for line in (path, shortened(path, belief, field, footprint)):
        assert touches_nothing(line, belief, footprint.radius / RESOLUTION)


def touches_nothing(line, belief, radius):
    """Whether finely spaced points on a polyline keep ``radius`` cells from all occupied squares and lie
    in free cells."""
    obstacles = np.argwhere(belief > 0)
    for tail, head in pairwise(line):
        steps = np.linspace(0, 1, 8 * int(np.abs(head - tail).max()) + 1)[:, None]
        points = tail + steps * (head - tail)
        inner = np.abs(points - np.floor(points) - 0.5).min(axis=1) > 1e-6  # not on a border between cells
        cells = np.rint(points[inner]).astype(int)
        if (belief[cells[:, 0], cells[:, 1]] >= 0).any():
            return False
        if len(obstacles):
            gaps = np.maximum(np.abs(points[:, None] - obstacles[None]) - 0.5, 0)
            if np.hypot(gaps[..., 0], gaps[..., 1]).min() < radius - 1e-6:
                return False
    return True


@pytest.mark.parametrize(("width", "fits"), [(15, True), (14, False)])
def test_a_passage_is_taken_exactly_where_the_disc_fits(width, fits):
    belief = np.full((60, 80), -5, np.int8)
    belief[:, 40:48] = 9
    belief[20 : 20 + width, 40:48] = -5  # 15 cells of 0.025 m hold a disc of 0.36 m at a cell's centre, 14 do not
    space, field = made(belief)
    found = plan(space, belief, field, (30, 10), (30, 70), Footprint(0.18, 0.33))
    assert (found is not None) == fits


def test_a_passage_at_45_degrees_is_taken_where_the_disc_fits():
    rows, columns = np.indices((90, 90))
    belief = np.where(np.abs(rows - columns) <= 11, -5, 9).astype(np.int8)
    space, field = made(belief)
    assert field.at((45, 46)) < 0.193 < field.at((45, 45))  # only the cells of the diagonal itself hold the disc
    found = plan(space, belief, field, (20, 20), (70, 70), Footprint(0.193, 0.33))
    assert found is not None
    assert touches_nothing(found[1], belief, 0.193 / RESOLUTION)
    assert plan(space, belief, field, (20, 20), (70, 70), Footprint(0.195, 0.33)) is None


def test_paths_keep_off_walls_where_there_is_room():
    belief = np.full((60, 200), -5, np.int8)
    belief[0] = belief[-1] = 9
    space, field = made(belief)
    footprint = Footprint(0.18, 0.4)
    _, path = plan(space, belief, field, (9, 10), (9, 190), footprint)
    assert path[:, 0].max() >= 15


def test_points_and_cells_convert_both_ways():
    points = np.array([[0.3, -0.7], [1.01, 2.02]])
    cells = cells_of(points, (-1.0, -1.0), RESOLUTION)
    assert cells.tolist() == [[12, 52], [120, 80]]
    assert np.abs(centres_of(cells, (-1.0, -1.0), RESOLUTION) - points).max() <= 0.5 * RESOLUTION + 1e-9


def test_bad_input_is_named():
    belief = np.full((20, 20), -5, np.int8)
    space, field = made(belief)
    with pytest.raises(ValueError, match="start"):
        search(space, belief, field, (20, 0), Footprint())
    with pytest.raises(ValueError, match="goal"):
        plan(space, belief, field, (0, 0), (0, -1), Footprint())
    with pytest.raises(ValueError, match="log_odds has shape"):
        search(space, np.zeros((5, 5), np.int8), field, (0, 0), Footprint())
    for beyond in (-1.0, math.nan):
        with pytest.raises(ValueError, match="beyond is"):
            Until(beyond=beyond)
    with pytest.raises(ValueError, match="preferred"):
        search(space, belief, field, (0, 0), Footprint(0.2, 0.7))
    with pytest.raises(ValueError, match="radius is"):
        Footprint(0.3, 0.2)
    with pytest.raises(ValueError, match="penalty"):
        Footprint(penalty=-1.0)
    with pytest.raises(ValueError, match="a map of 0 rows and 5 columns"):
        SearchSpace((0, 5), RESOLUTION)


@given(seed=SEEDS)
def test_a_goal_that_cannot_be_reached_in_a_blocked_disc_ends_no_search(seed):
    belief = random_belief(seed, shape=(60, 70), walls=4)
    footprint = Footprint(0.05, 0.15, 3.0)
    start = open_start(belief, footprint, seed)
    if start is None or max(abs(start[0] - 30), abs(start[1] - 30)) < 5:
        return
    space, field = made(belief)
    blocked = [(30, 30, 3)]
    full = search(space, belief, field, start, footprint, blocked=blocked).costs()
    towards = search(space, belief, field, start, footprint, blocked=blocked, until=Until(goal=(30, 30))).costs()
    np.testing.assert_array_equal(towards, full)
