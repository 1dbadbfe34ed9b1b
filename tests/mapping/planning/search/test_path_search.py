"""Searches in kernels: the same paths as the search of one body, and memory as it was before."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from searched_beliefs import made, open_start, random_belief

from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint, passage_of
from lidarium.mapping.planning.grid_planning import Until, plan, search
from lidarium.mapping.planning.search.path_search import (
    SearchMemory,
    SearchSpace,
    budget_of,
    check_shape,
    clear_memory,
    find_path,
    search_all,
)
from lidarium.mapping.planning.search.search_state import STRAIGHT, Terrain

RESOLUTION = 0.05
BODY = Footprint(0.08, 0.15, 3.0)


def belief(seed, shape=(40, 64)):
    generator = np.random.default_rng(seed)
    log_odds = np.full(shape, -20, np.int8)
    log_odds[generator.random(shape) < 0.05] = 20
    log_odds[generator.random(shape) < 0.1] = 0
    clearance = ClearanceField(shape, RESOLUTION, 0.6)
    clearance.update(log_odds)
    return log_odds, clearance


def memory_for(clearance, cells=64 * 64):
    passage = passage_of(BODY, RESOLUTION, clearance.limit)
    memory = SearchMemory(2)
    memory.fit(cells, passage.slots)
    return passage, memory


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60)
def test_a_path_is_that_of_the_search_of_all_and_the_memory_is_blank_again(seed):
    log_odds, clearance = belief(seed)
    passage, memory = memory_for(clearance)
    generator = np.random.default_rng(seed)
    discs = np.array([[generator.uniform(0, 40), generator.uniform(0, 64), 4.0]])
    bodies = [tuple(disc) for disc in discs.tolist()]
    for _ in range(4):
        start, goal = generator.integers(0, (40, 64), (2, 2)).tolist()
        found = search(SearchSpace(log_odds.shape, RESOLUTION), log_odds, clearance, tuple(start), BODY, blocked=bodies)
        cost, cells = find_path(
            Terrain(log_odds, clearance.closeness, passage, discs),
            memory.table[1],
            tuple(start),
            tuple(goal),
            budget_of(math.inf, RESOLUTION),
        )
        assert (cost < 0) == math.isinf(found.cost(tuple(goal)))
        if cost >= 0:
            assert cost * (RESOLUTION / STRAIGHT) == found.cost(tuple(goal))
            assert cells[0].tolist() == start
            assert cells[-1].tolist() == goal
            assert np.abs(np.diff(cells, axis=0)).max(initial=0) <= 1
        planned = plan(
            SearchSpace(log_odds.shape, RESOLUTION),
            log_odds,
            clearance,
            tuple(start),
            tuple(goal),
            BODY,
            blocked=discs.tolist(),
        )
        assert (planned is None) == (cost < 0)
        assert planned is None or np.array_equal(planned[1], cells)


def test_a_memory_serves_grids_of_any_shape_one_after_the_other():
    shapes = ((40, 64), (20, 128), (64, 64))
    results = []
    passage, memory = memory_for(belief(0)[1])
    for _ in range(2):
        for k, shape in enumerate(shapes):
            log_odds, clearance = belief(k, shape)
            log_odds[5:9, 5:9] = -20
            clearance.update(log_odds)
            remaining, _, count, least = search_all(log_odds, clearance.closeness, passage, memory.table[0], 7, 7)
            results.append((np.where(remaining >= least, remaining, 0).tobytes(), count))
            clear_memory(memory.table[0], *shape, count)
    assert results[:3] == results[3:]
    assert len(set(results)) == 3


def test_a_path_dearer_than_the_budget_is_none():
    log_odds, clearance = np.full((20, 64), -20, np.int8), ClearanceField((20, 64), RESOLUTION, 0.6)
    passage, memory = memory_for(clearance)
    for maximum, reachable in ((1.9, False), (2.1, True)):
        cost, cells = find_path(
            Terrain(log_odds, clearance.closeness, passage, np.empty((0, 3))),
            memory.table[0],
            (10, 10),
            (10, 50),
            budget_of(maximum, RESOLUTION),
        )
        assert (cost >= 0) == reachable
        assert len(cells) == (41 if reachable else 0)


def test_copies_of_a_memory_have_memory_of_their_own():
    memory = memory_for(belief(0)[1])[1]
    twin = copy.deepcopy(memory)
    assert twin.table.shape == memory.table.shape
    assert not (twin.table[:, :4] == memory.table[:, :4]).any()
    assert np.array_equal(twin.table[:, 4:], memory.table[:, 4:])


def test_a_belief_that_kernels_cannot_read_is_refused():
    log_odds, clearance = belief(0)
    space = SearchSpace(log_odds.shape, RESOLUTION)
    for bad in (np.asfortranarray(log_odds), log_odds.astype(np.int16)):
        with pytest.raises(ValueError, match="want C-contiguous int8"):
            search(space, bad, clearance, (5, 5), BODY)


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


@pytest.mark.parametrize("shape", [(32_768, 2), (2, 32_768), (0, 5)])
def test_maps_whose_cells_have_no_number_are_refused(shape):
    rows, columns = shape
    with pytest.raises(ValueError, match=f"a map of {rows} rows and {columns} columns cannot be searched; want 1 to"):
        check_shape(shape)
