"""A* finds the cheapest path."""

import itertools
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from lidarium.mapping.sparse.changing_graph import ChangingGraph
from lidarium.mapping.sparse.graph import GraphSettings, build_graph
from lidarium.mapping.sparse.planning import (
    _path_length,
    _pop,
    _push,
    _shortened,
    _shortest_path,
    costs_from,
    measure_path,
    plan,
    points_along,
)
from lidarium.mapping.sparse.swept_body import SweptBody, are_free, index_boxes, is_free

BODY = SweptBody(radius=0.25, height=1.0)


@pytest.mark.parametrize("seed", range(20))
def test_costs_are_those_of_dijkstra(seed):
    generator = np.random.default_rng(seed)
    for _ in range(10):
        count = int(generator.integers(2, 120))
        nodes = generator.uniform(0.0, 5.0, (count, 3))
        graph = build_graph(nodes, np.zeros((0, 2, 3)), BODY, GraphSettings(merge_radius=0.0, neighbours=3))
        first, last = np.full(count, np.inf), np.full(count, np.inf)
        source, target = generator.integers(count, size=2)
        first[source] = last[target] = 0.0
        path, cost = _shortest_path(
            graph.nodes, graph.starts, graph.ends, graph.weights, first, last, graph.nodes[target]
        )
        matrix = csr_array((graph.weights, graph.ends, graph.starts), shape=(count, count))
        expected = dijkstra(matrix, indices=int(source))[target]
        assert cost == pytest.approx(expected)
        if np.isfinite(expected):
            steps = np.linalg.norm(np.diff(graph.nodes[path], axis=0), axis=1)
            assert steps.sum() == pytest.approx(expected)
        else:
            assert len(path) == 0


def test_a_heap_gives_its_nodes_back_in_order():
    generator = np.random.default_rng(1)
    costs = generator.integers(0, 50, 200).astype(float)
    heap, keys, size = np.empty(200, np.int64), np.empty(200), 0
    for node, cost in enumerate(costs.tolist()):
        size = _push(heap, keys, size, node, cost)
    taken = []
    while size > 0:
        taken.append((float(keys[0]), int(heap[0])))
        size = _pop(heap, keys, size)
    assert [key for key, _ in taken] == sorted(costs.tolist())
    assert sorted(node for _, node in taken) == list(range(200))
    assert all(costs[node] == key for key, node in taken)


def test_of_several_first_and_last_nodes_the_cheapest_pair_is_taken():
    nodes = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    starts, ends = np.array([0, 1, 3, 5, 6]), np.array([1, 0, 2, 1, 3, 2])
    weights, goal = np.ones(6), np.array([3.5, 0.0, 0.0])
    first = np.array([0.5, 2.0, np.inf, np.inf])
    path, cost = _shortest_path(nodes, starts, ends, weights, first, np.array([np.inf, np.inf, 1.6, 0.5]), goal)
    assert (path.tolist(), cost) == ([0, 1, 2, 3], 4.0)
    path, cost = _shortest_path(nodes, starts, ends, weights, first, np.array([np.inf, 2.5, 1.6, 0.5]), goal)
    assert (path.tolist(), cost) == ([0, 1], 4.0)
    path, cost = _shortest_path(nodes, starts, ends, weights, np.full(4, np.inf), np.zeros(4), goal)
    assert (len(path), cost) == (0, np.inf)


BODY_OF_SHORTCUTS = SweptBody(radius=0.2, height=1.0)
WALL = np.array([[[1.9, -5.0, 0.0], [2.1, 1.0, 2.0]]])
NOTHING = np.empty((0, 2, 3))


def path_of(*points):
    return np.array([(x, y, 0.0) for x, y in points])


def test_the_length_is_that_of_the_segments():
    assert _path_length(path_of((0.0, 0.0), (3.0, 4.0), (3.0, 5.0))) == pytest.approx(6.0)
    assert _path_length(path_of((1.0, 1.0))) == 0.0


def test_a_path_in_the_open_becomes_straight():
    steps = path_of(*((0.1 * k, math.sin(k)) for k in range(60)))
    found = _shortened(index_boxes(NOTHING), steps, BODY_OF_SHORTCUTS.numbers)
    np.testing.assert_array_equal(found, steps[[0, -1]])


def test_a_detour_around_a_wall_becomes_tight_and_stays_free():
    index = index_boxes(WALL)
    detour = path_of((0.0, 0.0), (0.0, 2.0), (0.5, 3.5), (2.0, 4.0), (3.5, 3.5), (4.0, 2.0), (4.0, 0.0))
    found = _shortened(index, detour, BODY_OF_SHORTCUTS.numbers)
    np.testing.assert_array_equal(found[[0, -1]], detour[[0, -1]])
    assert all(is_free(index, a, b, BODY_OF_SHORTCUTS.numbers) for a, b in pairwise(found))
    # The shortest goes round the two corners of the wall at the radius of the body.
    at_corner = math.hypot(1.9 - 0.0, 1.0)
    least = 2.0 * math.sqrt(at_corner**2 - 0.2**2) + 0.2
    assert least < _path_length(found) < 0.65 * _path_length(detour)


def test_a_path_of_one_or_two_points_stays():
    index = index_boxes(WALL)
    for path in (path_of((0.0, 0.0)), path_of((0.0, 0.0), (1.0, 0.0))):
        np.testing.assert_array_equal(_shortened(index, path, BODY_OF_SHORTCUTS.numbers), path)


BOXES = np.array(
    [
        [[2.9, -1.0, 0.0], [3.1, 4.0, 2.5]],
        [[4.5, 2.0, 0.7], [5.5, 3.2, 0.75]],
        [[1.0, 1.0, 0.0], [1.6, 1.6, 0.5]],
    ]
)


def room(boxes=BOXES):
    generator = np.random.default_rng(0)
    free = np.column_stack([generator.uniform(0.0, 6.0, (1200, 2)), np.zeros(1200)])
    return build_graph(free, boxes, BODY, GraphSettings())


def is_path_free(path, boxes, body):
    """The oracle: points of the path every centimetre, against all boxes."""
    for a, b in pairwise(path):
        count = max(math.ceil(np.linalg.norm(b - a) / 0.01), 1)
        points = a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a)
        for low, high in boxes:
            beyond = np.maximum(np.maximum(low[:2] - points[:, :2], points[:, :2] - high[:2]), 0.0)
            is_near = np.hypot(*beyond.T) < body.radius - 1e-9
            if (is_near & (low[2] < body.height) & (high[2] > body.clearance)).any():
                return False
    return True


def test_paths_are_free_and_hardly_longer_than_they_need_to_be():
    graph, generator = room(), np.random.default_rng(1)
    found = 0
    while found < 60:
        start, goal = generator.uniform(0.2, 5.8, (2, 2))
        answer = plan(graph, start, goal)
        if not answer.is_found:
            assert answer.reason in ("start in collision", "goal in collision")
            continue
        found += 1
        assert is_path_free(answer.path, BOXES, BODY)
        assert answer.path[0, :2].tolist() == start.tolist()
        assert answer.path[-1, :2].tolist() == goal.tolist()
        on_graph = plan(graph, start, goal, shortens=False)
        assert is_path_free(on_graph.path, BOXES, BODY)
        assert answer.length <= on_graph.length + 1e-9


def test_around_the_end_of_a_wall_the_path_is_nearly_the_shortest():
    wall = BOXES[:1]
    answer = plan(room(wall), np.array([1.0, 1.0]), np.array([5.0, 1.0]))
    # Tangents to circles of the body's radius around the two corners at the wall's end, and arcs on these.
    side, radius = math.hypot(1.9, 3.0), BODY.radius
    rising = math.atan2(3.0, 1.9) + math.asin(radius / side)
    shortest = 2.0 * math.sqrt(side**2 - radius**2) + 0.2 + 2.0 * radius * rising
    assert shortest < answer.length < 1.02 * shortest


def test_requests_that_cannot_be_answered_say_why():
    graph = room()
    free, wall, table = np.array([1.0, 4.0]), np.array([3.0, 1.0]), np.array([5.0, 2.5])
    assert plan(graph, wall, free).reason == "start in collision"
    assert plan(graph, free, table).reason == "goal in collision"
    closed = np.concatenate([BOXES, [[[2.9, 3.9, 0.0], [3.1, 8.0, 2.5]]]])
    answer = plan(room(closed), free, np.array([5.0, 5.0]))
    assert answer.reason == "no path"
    assert answer.length == math.inf


def test_an_obstacle_turns_a_path_aside_until_it_goes():
    changing = ChangingGraph(room(BOXES[:1]))
    start, goal = np.array([0.5, 5.0]), np.array([5.5, 5.0])
    before = plan(changing.graph, start, goal)
    assert len(before.path) == 2
    number = changing.insert(np.array([[2.8, 4.8, 0.2], [3.2, 5.2, 0.8]]))
    aside = plan(changing.graph, start, goal)
    assert aside.is_found
    assert aside.length > before.length
    boxes = np.concatenate([BOXES[:1], [changing.obstacles[number]]])
    assert is_path_free(aside.path, boxes, BODY)
    changing.remove(number)
    assert (plan(changing.graph, start, goal).path == before.path).all()


@pytest.mark.parametrize("point", [np.zeros(4), np.array([np.nan, 0.0]), 3.0])
def test_terminals_that_are_no_points_are_refused(point):
    with pytest.raises(ValueError, match="start is"):
        plan(room(), point, np.zeros(2))


def test_equal_requests_have_equal_paths():
    first, second = (plan(room(), np.array([0.5, 0.5]), np.array([5.5, 0.5])) for _ in range(2))
    assert (first.path == second.path).all()
    assert are_free(room().index, first.path[:-1], first.path[1:], BODY.numbers).all()


WALL_OF_REACH = np.array([[[2.9, -1.0, 0.0], [3.1, 4.0, 2.5]]])


@pytest.mark.parametrize("seed", range(4))
def test_costs_are_those_of_the_paths_that_are_planned(seed):
    generator = np.random.default_rng(seed)
    free = np.column_stack([generator.uniform(0.0, 6.0, (400, 2)), np.zeros(400)])
    graph = build_graph(free, WALL_OF_REACH, BODY, GraphSettings())
    start = np.array([1.0, 1.0, 0.0])
    costs = costs_from(graph, start)
    assert costs.shape == (len(graph.nodes),)
    for node in range(0, len(graph.nodes), 7):
        planned = plan(graph, start, graph.nodes[node], shortens=False)
        # A request also goes straight from a neighbour of the goal, which no edge may do.
        assert planned.is_found == np.isfinite(costs[node])
        assert planned.length <= costs[node] + 1e-9
        assert costs[node] <= planned.length + 0.5
    assert costs.min() < 0.5


def test_what_lies_behind_a_wall_is_out_of_reach():
    free = np.array([[x, y, 0.0] for x in np.arange(0.0, 6.0, 0.4) for y in np.arange(0.0, 2.0, 0.4)])
    graph = build_graph(free, np.array([[[2.9, -9.0, 0.0], [3.1, 9.0, 2.5]]]), BODY)
    costs = costs_from(graph, np.array([1.0, 1.0, 0.0]))
    assert np.isfinite(costs[graph.nodes[:, 0] < 2.6]).all()
    assert np.isinf(costs[graph.nodes[:, 0] > 3.4]).all()


def test_a_straight_line_does_not_turn():
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    found = measure_path(line)
    assert found.length == 3.0
    assert found.points == 3
    assert found.turning == pytest.approx(0.0, abs=1e-9)
    # Evenly spaced on a line: its length over the root of 12, for many points.
    assert found.dispersion == pytest.approx(3.0 / math.sqrt(12.0), rel=0.03)


def test_a_right_angle_turns_by_a_right_angle():
    corner = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])
    assert measure_path(corner).turning == pytest.approx(math.pi / 2.0)
    assert measure_path(corner, None).turning == pytest.approx(math.pi / 2.0)
    assert measure_path(corner).length == 3.0


def test_a_turn_back_is_half_a_turn_and_standing_is_none():
    back = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    assert measure_path(back, None).turning == pytest.approx(math.pi)
    still = measure_path(np.zeros((1, 3)))
    assert (still.length, still.turning, still.dispersion) == (0.0, 0.0, 0.0)


@given(st.lists(st.tuples(*[st.floats(-5.0, 5.0)] * 2), min_size=2, max_size=12))
def test_measures_equal_the_formulas_point_by_point(corners):
    path = np.array(corners)
    found = measure_path(path, None)
    turning = 0.0
    steps = [b - a for a, b in itertools.pairwise(path) if np.linalg.norm(b - a) > 1e-12]
    for first, second in itertools.pairwise(steps):
        cosine = first @ second / (np.linalg.norm(first) * np.linalg.norm(second))
        turning += math.acos(min(max(cosine, -1.0), 1.0))
    assert found.turning == pytest.approx(turning, abs=1e-6)
    mean = path.mean(axis=0)
    squares = sum(float((point - mean) @ (point - mean)) for point in path)
    assert found.dispersion == pytest.approx(math.sqrt(squares / (len(path) - 1)))


def test_points_are_spaced_evenly_and_the_ends_stay():
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    points = points_along(path, 0.3)
    assert points[0].tolist() == [0.0, 0.0]
    assert points[-1].tolist() == [1.0, 1.0]
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= 0.3


@pytest.mark.parametrize("path", [np.empty((0, 2)), np.array([[0.0, math.nan]]), np.zeros(3)])
def test_what_is_no_path_is_refused(path):
    with pytest.raises(ValueError, match="the path has shape"):
        measure_path(path)
