"""Lower bounds on walks, on graphs whose shortest walks are known."""

import numpy as np
import pytest
from linked_places import STAR, graph_of

from lidarium.evaluation.bounds.relaxation import relax
from lidarium.evaluation.bounds.tours import plan_tours

pytest.importorskip("ortools", reason="OR-Tools is not installed")


def test_a_star_is_walked_to_its_longest_end_last():
    graph = graph_of(STAR, [[2], [4], [6]])
    found = relax(graph, 1.0, exact_s=20.0)
    assert found.lower_m == pytest.approx(2 * 2 + 2 * 3 + 4)
    assert found.optimum_m == pytest.approx(14.0)
    assert plan_tours(graph, 1.0, 50).lengths[0] == pytest.approx(14.0)


def test_an_end_that_need_not_be_seen_is_left_out():
    graph = graph_of(STAR, [[2], [4], [6]])
    assert relax(graph, 0.6).lower_m <= relax(graph, 0.6, exact_s=20.0).optimum_m == pytest.approx(2 * 2 + 3)
    assert plan_tours(graph, 0.6, 50).lengths[0] == pytest.approx(7.0)


def test_a_bound_that_has_no_more_time_holds_and_is_looser():
    graph = graph_of(STAR, [[2], [4], [6]])
    whole, broken_off = relax(graph, 1.0), relax(graph, 1.0, limit_s=0.0)
    assert 0.0 <= broken_off.lower_m < whole.lower_m
    assert broken_off.cuts == 0 < whole.cuts


def test_what_is_seen_from_the_start_costs_nothing():
    graph = graph_of(STAR, [[0, 2], [0, 4]])
    assert relax(graph, 1.0, exact_s=10.0).optimum_m == pytest.approx(0.0)
    assert plan_tours(graph, 1.0, 10).lengths[0] == 0.0


def test_robots_share_out_the_arms():
    links = [(0, 1, 1.0), (0, 2, 2.0), (1, 3, 2.0), (2, 4, 1.0)]
    graph = graph_of(links, [[3], [4]], robots=2)
    plan = plan_tours(graph, 1.0, 50)
    assert plan.lengths.tolist() == pytest.approx([3.0, 2.0]) or plan.lengths.max() <= 3.0
    assert relax(graph, 1.0, exact_s=10.0).lower_m <= plan.lengths.sum() + 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_the_bound_holds_for_plans_on_drawn_graphs_and_the_optimum_lies_between(seed):
    generator = np.random.default_rng(seed)
    places = generator.uniform(0.0, 10.0, (14, 2))
    links = [
        (i, j, float(np.hypot(*(places[i] - places[j]))))
        for i in range(14)
        for j in range(i)
        if j == i - 1 or np.hypot(*(places[i] - places[j])) < 4.0
    ]
    seen_by = [generator.choice(14, size=2, replace=False).tolist() for _ in range(20)]
    graph = graph_of(links, seen_by)
    plan = plan_tours(graph, 0.9, 200)
    found = relax(graph, 0.9, exact_s=30.0)
    assert plan.share >= 0.9
    assert 0.0 < found.lower_m <= found.optimum_m + 1e-6
    assert found.optimum_m <= plan.lengths[0] + 1e-6
    assert plan.lengths[0] <= 1.15 * found.optimum_m
