"""Paths are the cheapest of the graph, free of collisions, and short."""

import math
from itertools import pairwise

import numpy as np
import pytest

from lidarium.mapping.sparse.graph.obstacles import ChangingGraph
from lidarium.mapping.sparse.graph.topological_graph import GraphSettings, build_graph
from lidarium.mapping.sparse.planning.requests import plan
from lidarium.mapping.sparse.swept_body import SweptBody, are_free

BODY = SweptBody(radius=0.25, height=1.0)
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
