"""Searches against scipy's Dijkstra over an explicit graph, and paths against what a disc touches."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from lidarium.mapping.planning.clearance import ClearanceField, clearance
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import Until, cells_of, centres_of, discs_of, plan, search
from lidarium.mapping.planning.path_smoothing import line_keeps_clearance, shortened, waypoints
from lidarium.mapping.planning.search.search_space import SearchSpace
from lidarium.mapping.planning.search.search_targets import Targets

RESOLUTION = 0.025
SEEDS = st.integers(0, 10**6)


def random_belief(seed, shape=(36, 40), walls=6, unknown=2):
    """Free floor with short walls, patches of unknown and an occupied rim in places."""
    random = np.random.default_rng(seed)
    belief = np.full(shape, -5, np.int8)
    for value, count in ((9, walls), (0, unknown)):
        for _ in range(count):
            row, column = random.integers(0, shape[0]), random.integers(0, shape[1])
            length = random.integers(1, 14)
            if random.random() < 0.5:
                belief[row : row + length, column : column + 1 + (value == 0) * length] = value
            else:
                belief[row, column : column + length] = value
    return belief


def made(belief, maximum=0.6, resolution=RESOLUTION):
    field = ClearanceField(belief.shape, resolution, maximum)
    field.update(belief)
    return SearchSpace(belief.shape, resolution), field


def oracle(belief, footprint, start, closed=None):
    """Costs [m] by scipy over all steps that keep the clearance, with costs in floating point."""
    room = clearance(belief > 0, RESOLUTION, 0.6).astype(float)
    squared = np.rint((room / RESOLUTION * 2) ** 2).astype(int)
    least = math.ceil((2 * footprint.radius / RESOLUTION) ** 2 - 1e-6)
    open_cells = (belief < 0) & (squared >= max(least, 1))
    if closed is not None:
        open_cells &= ~closed
    width = footprint.preferred - footprint.radius
    factor = 1.0 + footprint.penalty * np.clip((footprint.preferred - room) / width, 0, 1) ** 2
    fits = (belief < 0) & (squared >= max(least, 1))
    rows, columns = belief.shape
    tails, heads, costs = [], [], []
    for row, column in np.argwhere(open_cells):
        for up in (-1, 0, 1):
            for right in (-1, 0, 1):
                to_row, to_column = row + up, column + right
                if (
                    (up == 0 and right == 0)
                    or not (0 <= to_row < rows and 0 <= to_column < columns)
                    or not open_cells[to_row, to_column]
                ):
                    continue
                if up and right:
                    if min(squared[row, column], squared[to_row, to_column]) - 2 >= least:
                        fine = belief[to_row, column] < 0 or belief[row, to_column] < 0
                    else:
                        fine = fits[to_row, column] and fits[row, to_column]
                    if not fine:
                        continue
                tails.append(row * columns + column)
                heads.append(to_row * columns + to_column)
                costs.append(
                    math.hypot(up, right)
                    * RESOLUTION
                    * 0.5
                    * (factor[row, column] + factor[to_row, to_column])
                )
    graph = coo_matrix((costs, (tails, heads)), shape=(belief.size, belief.size)).tocsr()
    return dijkstra(graph, indices=start[0] * columns + start[1]).reshape(belief.shape), open_cells


def open_start(belief, footprint, seed):
    room = clearance(belief > 0, RESOLUTION, 0.6)
    cells = np.argwhere((belief < 0) & (room >= footprint.radius + 1e-6))
    return None if len(cells) == 0 else tuple(int(i) for i in np.random.default_rng(seed).choice(cells))


def beginning(seed):
    """A body, a belief with many walls, where the body stands in it, and what searches want."""
    footprint, belief = Footprint(0.03, 0.1, 3.0), random_belief(seed, shape=(50, 60), walls=10)
    start = open_start(belief, footprint, seed)
    assume(start is not None)
    return footprint, belief, start, *made(belief)


@settings(max_examples=40)
@given(
    seed=SEEDS, radius=st.sampled_from([0.0, 0.03, 0.05, 0.0625]), penalty=st.sampled_from([0.0, 3.0, 40.0])
)
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


@settings(max_examples=30)
@given(seed=SEEDS, count=st.integers(1, 5), reach=st.sampled_from([0.0, 2.5, 9.0]))
def test_the_first_targets_are_the_cheapest_of_the_full_search(seed, count, reach):
    footprint, belief, start, space, field = beginning(seed)
    mask = np.random.default_rng(seed).random(belief.shape) < 0.003
    targets = Targets.of(mask, reach)
    everything = search(space, belief, field, start, footprint, until=Until(targets=targets, count=10**9))
    hits = everything.hits
    costs = np.array([everything.cost(cell) for cell in hits])
    assert (np.diff(costs) >= 0).all()
    early = search(space, belief, field, start, footprint, until=Until(targets=targets, count=count))
    np.testing.assert_array_equal(early.hits, hits[:count])
    np.testing.assert_array_equal([early.cost(cell) for cell in early.hits], costs[:count])
    if reach == 0.0:
        full = search(space, belief, field, start, footprint).costs()
        assert len(hits) == np.isfinite(full[mask]).sum()


@settings(max_examples=30)
@given(seed=SEEDS, beyond=st.sampled_from([0.05, 0.3, 1.0, 1e9]))
def test_beyond_the_first_target_costs_are_those_of_the_full_search(seed, beyond):
    footprint, belief, start, space, field = beginning(seed)
    targets = Targets.of(np.random.default_rng(seed).random(belief.shape) < 0.003, 2.5)
    full = search(space, belief, field, start, footprint).costs()
    first = search(space, belief, field, start, footprint, until=Until(targets=targets)).hits
    found = search(space, belief, field, start, footprint, until=Until(targets=targets, beyond=beyond))
    np.testing.assert_array_equal(found.hits, first)
    most = found.cost(tuple(found.hits[0])) + beyond if len(found.hits) else np.inf
    np.testing.assert_array_equal(
        np.where(full <= most, found.costs(), np.inf), np.where(full <= most, full, np.inf)
    )
    further = found.costs()[np.isfinite(found.costs())].max()
    assert further <= most + 3 * 4096 * found.unit


@settings(max_examples=30)
@given(seed=SEEDS, count=st.integers(1, 6))
def test_a_search_for_some_cells_ends_when_all_of_them_have_their_costs(seed, count):
    footprint, belief, start, space, field = beginning(seed)
    full = search(space, belief, field, start, footprint).costs()
    reached = np.argwhere(np.isfinite(full))
    cells = {tuple(map(int, cell)) for cell in np.random.default_rng(seed).choice(reached, count)}
    found = search(
        space,
        belief,
        field,
        start,
        footprint,
        until=Until(targets=Targets.at(cells, belief.shape), count=len(cells)),
    )
    assert {cell: found.cost(cell) for cell in cells} == {cell: full[cell] for cell in cells}
    assert {tuple(cell) for cell in found.hits.tolist()} == cells


def test_searches_do_not_see_what_earlier_searches_left():
    belief = random_belief(3, shape=(60, 70))
    footprint = Footprint(0.03, 0.1)
    space, field = made(belief)
    start, other = open_start(belief, footprint, 1), open_start(belief, footprint, 2)
    first = search(space, belief, field, start, footprint).costs()
    old = search(space, belief, field, other, footprint, until=Until(maximum_cost=0.3))
    assert old.costs()[np.isfinite(old.costs())].max() <= 0.3
    np.testing.assert_array_equal(search(space, belief, field, start, footprint).costs(), first)
    with pytest.raises(ValueError, match="another search"):
        old.cost(start)


def test_the_reached_cells_are_those_with_finite_costs():
    belief = random_belief(5, shape=(60, 70))
    footprint = Footprint(0.05, 0.1)
    space, field = made(belief)
    found = search(space, belief, field, open_start(belief, footprint, 1), footprint)
    mask = np.zeros(belief.shape, bool)
    mask[tuple(found.reached().T)] = True
    np.testing.assert_array_equal(mask, np.isfinite(found.costs()))


@pytest.mark.parametrize(("width", "fits"), [(15, True), (14, False)])
def test_a_passage_is_taken_exactly_where_the_disc_fits(width, fits):
    belief = np.full((60, 80), -5, np.int8)
    belief[:, 40:48] = 9
    belief[
        20 : 20 + width, 40:48
    ] = -5  # 15 cells of 0.025 m hold a disc of 0.36 m at a cell's centre, 14 do not
    space, field = made(belief)
    found = plan(space, belief, field, (30, 10), (30, 70), Footprint(0.18, 0.33))
    assert (found is not None) == fits


def test_a_passage_at_45_degrees_is_taken_where_the_disc_fits():
    rows, columns = np.indices((90, 90))
    belief = np.where(np.abs(rows - columns) <= 11, -5, 9).astype(np.int8)
    space, field = made(belief)
    assert (
        field.at((45, 46)) < 0.193 < field.at((45, 45))
    )  # only the cells of the diagonal itself hold the disc
    found = plan(space, belief, field, (20, 20), (70, 70), Footprint(0.193, 0.33))
    assert found is not None
    assert touches_nothing(found[1], belief, 0.193 / RESOLUTION)
    assert plan(space, belief, field, (20, 20), (70, 70), Footprint(0.195, 0.33)) is None


def test_no_step_cuts_a_corner_between_two_blocked_cells():
    belief = np.full((2, 2), -5, np.int8)
    belief[0, 1] = belief[1, 0] = 9
    space, field = made(belief, 0.1)
    assert plan(space, belief, field, (0, 0), (1, 1), Footprint(0.0, 0.05)) is None
    belief[:] = -5
    belief[0, 1] = belief[1, 0] = 0
    space, field = made(belief, 0.1)
    assert plan(space, belief, field, (0, 0), (1, 1), Footprint(0.0, 0.05)) is None


def test_paths_keep_off_walls_where_there_is_room():
    belief = np.full((60, 200), -5, np.int8)
    belief[0] = belief[-1] = 9
    space, field = made(belief)
    footprint = Footprint(0.18, 0.4)
    _, path = plan(space, belief, field, (9, 10), (9, 190), footprint)
    assert path[:, 0].max() >= 15


def test_a_body_too_near_to_a_wall_leaves_it():
    belief = np.full((60, 60), -5, np.int8)
    belief[:, 0] = 9
    space, field = made(belief)
    footprint = Footprint(0.18, 0.33)
    found = search(space, belief, field, (30, 5), footprint)
    path = found.path((30, 40))
    assert tuple(path[0]) == (30, 5)
    assert (np.diff(path[:4, 1]) == 1).all()
    assert found.cost((30, 5)) == 0.0
    assert math.isinf(found.cost((30, 6)))


def test_blocked_discs_are_passed_around_and_left():
    belief = np.full((80, 80), -5, np.int8)
    space, field = made(belief)
    footprint = Footprint(0.05, 0.1)
    discs = discs_of([(1.0, 1.0, 0.4)], (0.0, 0.0), RESOLUTION)
    found = search(space, belief, field, (39, 5), footprint, blocked=discs)
    centres = centres_of(found.path((39, 75)), (0.0, 0.0), RESOLUTION)
    assert np.hypot(*(centres - 1.0).T).min() >= 0.4
    distances = np.hypot(
        *(np.moveaxis(np.indices(belief.shape), 0, -1)[..., ::-1].reshape(-1, 2).T + 0.5) * RESOLUTION - 1.0
    ).reshape(80, 80)
    np.testing.assert_array_equal(np.isinf(found.costs()), distances < 0.4)
    line = waypoints(found.path((39, 75)), belief, field, footprint, blocked=discs)
    for tail, head in pairwise(line):
        points = tail + np.linspace(0, 1, 100)[:, None] * (head - tail)
        assert np.hypot(*(points - 1.0).T).min() >= 0.4 - 0.002
    inside = search(space, belief, field, (39, 30), footprint, blocked=discs)
    away = np.hypot(*(centres_of(inside.path((39, 5)), (0.0, 0.0), RESOLUTION) - 1.0).T)
    assert (np.diff(away) > 0).all()
    assert math.isinf(inside.cost((39, 39)))
    assert math.isfinite(inside.cost((39, 75)))


def test_a_free_line_becomes_two_waypoints_and_corners_few_more():
    belief = np.full((100, 100), -5, np.int8)
    space, field = made(belief)
    footprint = Footprint(0.18, 0.33)
    _, path = plan(space, belief, field, (10, 10), (37, 85), footprint)
    np.testing.assert_allclose(
        waypoints(path, belief, field, footprint, origin=(-1.0, 2.0)), [[-0.7375, 2.2625], [1.1375, 2.9375]]
    )
    belief[40:, 40:60] = 9
    field.update(belief)
    _, path = plan(space, belief, field, (80, 20), (80, 80), footprint)
    assert 3 <= len(shortened(path, belief, field, footprint)) <= 10


def test_line_clearance_is_exact():
    belief = np.full((40, 60), -5, np.int8)
    belief[20, 30] = 9
    _, field = made(belief)
    assert line_keeps_clearance((10, 5), (10, 55), belief, field, 9.5 * RESOLUTION)
    assert not line_keeps_clearance((10, 5), (10, 55), belief, field, 9.6 * RESOLUTION)
    corner = (np.array([19.5, 29.5]) - [0, 10]) @ np.array([1, -1]) / math.sqrt(2)
    assert not line_keeps_clearance((0, 10), (29, 39), belief, field, (abs(corner) + 0.01) * RESOLUTION)
    belief[10, 20] = 0
    assert not line_keeps_clearance((10, 5), (10, 55), belief, field, 0.0)


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
    with pytest.raises(ValueError, match="shape"):
        SearchSpace((0, 5), RESOLUTION)
    with pytest.raises(ValueError, match="path has shape"):
        shortened(np.zeros((0, 2), np.int64), belief, field, Footprint())
