"""Tours past views, on graphs whose shortest walks are known."""

import pytest
from linked_places import STAR, graph_of

from lidarium.evaluation.bounds.tours import (
    SUM_WEIGHT,
    cost_of,
    covered,
    lengths_of,
    ordered,
    plan_tours,
    walk_of,
)


def test_a_walk_passes_the_places_between_its_stops():
    graph = graph_of(STAR, [[2], [4], [6]])
    assert walk_of(graph, 0, [2, 4]) == [0, 1, 2, 1, 0, 3, 4]
    assert walk_of(graph, 0, []) == [0]
    assert lengths_of(graph, [[2, 4]]).tolist() == pytest.approx([2.0 + 2.0 + 3.0])


def test_the_longest_tour_costs_most():
    graph = graph_of([(0, 1, 1.0), (0, 2, 2.0), (1, 3, 2.0)], [[2], [3]], robots=2)
    assert lengths_of(graph, [[2], [3]]).tolist() == pytest.approx([2.0, 2.0])
    assert cost_of(graph, [[2], [3]]) == pytest.approx(2.0 + SUM_WEIGHT * 4.0)
    assert cost_of(graph, [[2, 3], []]) > cost_of(graph, [[2], [3]])


def test_stops_are_added_until_enough_is_seen_and_no_longer():
    graph = graph_of(STAR, [[2], [4], [6]])
    assert covered(graph, [[]], 1) == [[2]]
    assert sorted(covered(graph, [[]], 3)[0]) == [2, 4, 6]
    assert covered(graph, [[6]], 1) == [[6]]


def test_what_nobody_can_see_ends_the_search():
    graph = graph_of(STAR, [[2], []])
    assert covered(graph, [[]], 2) == [[2]]


def test_stops_are_ordered_so_that_the_longest_arm_comes_last():
    pytest.importorskip("ortools", reason="OR-Tools is not installed")
    (tour,) = ordered(graph_of(STAR, [[2], [4], [6]]), [[6, 2, 4]])
    assert tour[-1] == 6
    assert sorted(tour) == [2, 4, 6]


def test_a_plan_is_drawn_from_its_seed_and_sees_what_is_asked():
    pytest.importorskip("ortools", reason="OR-Tools is not installed")
    graph = graph_of(STAR, [[2], [4], [6], [0]])
    plan, again = (plan_tours(graph, 0.75, 20, seed=3) for _ in range(2))
    assert plan.walks == again.walks
    assert plan.walks[0][0] == 0
    assert 0.75 <= plan.share <= 1.0
    assert plan.lengths[0] == pytest.approx(7.0)
