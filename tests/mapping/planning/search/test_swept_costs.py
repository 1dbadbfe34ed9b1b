"""Costs by sweeps are those of a search cell by cell, to the unit."""

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.kernels.simd.costs import FAR, LANES
from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.footprint import Footprint, passage_of
from lidarium.mapping.planning.search.path_search import (
    SearchMemory,
    clear_memory,
    search_all,
    touched_in,
)
from lidarium.mapping.planning.search.search_state import LARGEST_BUDGET, LEAVING
from lidarium.mapping.planning.search.swept_costs import (
    SweepMemory,
    costs_in,
    prepare_costs,
    spread_costs,
    take_costs,
)

RESOLUTION = 0.05
BODIES = (Footprint(0.08, 0.15, 3.0), Footprint(0.0, 0.0, 0.0), Footprint(0.182, 0.33, 3.0))


def belief(seed, shape, walls):
    """Rooms with narrow gaps, specks, and cells that nobody has seen."""
    generator = np.random.default_rng(seed)
    log_odds = np.full(shape, -20, np.int8)
    for _ in range(walls):
        row, column = generator.integers(0, shape)
        if generator.random() < 0.5:
            log_odds[row, column : column + generator.integers(4, 40)] = 20
        else:
            log_odds[row : row + generator.integers(4, 40), column] = 20
    log_odds[generator.random(shape) < 0.01] = 20
    log_odds[generator.random(shape) < 0.03] = 0
    return log_odds


def searched(log_odds, clearance, passage, start):
    """Costs by the search cell by cell; ``FAR`` where the body cannot be but to leave a tight place."""
    memory = SearchMemory(1)
    memory.fit(log_odds.size, passage.slots)
    remaining, parent, count, least = search_all(log_odds, clearance.closeness, passage, memory.table[0], *start)
    touched = touched_in(memory.table[0], *log_odds.shape)[:count].copy()
    is_reached = remaining >= least
    is_reached[is_reached] &= parent[is_reached] < LEAVING
    costs = np.where(is_reached, LARGEST_BUDGET - remaining, FAR)
    return costs, (memory, remaining, parent, touched, least)


@given(seed=st.integers(0, 100_000), walls=st.integers(0, 12), body=st.sampled_from(BODIES))
@settings(max_examples=80)
def test_the_costs_are_those_of_a_search_cell_by_cell(seed, walls, body):
    generator = np.random.default_rng(seed)
    shape = (int(generator.integers(3, 60)), 16 * int(generator.integers(1, 7)))
    log_odds = belief(seed, shape, walls)
    clearance = ClearanceField(shape, RESOLUTION, 0.6)
    clearance.update(log_odds)
    passage = passage_of(body, RESOLUTION, clearance.limit)
    known = (log_odds != 0).any(axis=1).nonzero()[0], (log_odds != 0).any(axis=0).nonzero()[0]
    window = tuple(int(end) for side in known for end in (side.min(), side.max() + 1))
    sweeps = SweepMemory(1)
    sweeps.fit(*shape)
    swept = costs_in(sweeps.table[0], window)
    prepare_costs(swept, log_odds, clearance.closeness, passage)
    first = LANES - swept.column_low
    inside = swept.costs[1:-1, first + window[2] : first + window[3]]
    for _ in range(3):
        start = (int(generator.integers(0, shape[0])), int(generator.integers(0, shape[1])))
        expected, (memory, remaining, parent, touched, least) = searched(log_odds, clearance, passage, start)
        fits = log_odds[start] < 0 and passage.half_costs[0, clearance.closeness[start]] > 0
        assert spread_costs(swept, *start) == fits
        if not fits:
            assert (swept.costs == FAR).all()
            take_costs(swept, remaining, parent, touched, least)
        assert np.array_equal(inside, expected[window[0] : window[1], window[2] : window[3]])
        clear_memory(memory.table[0], *shape, len(touched))


def test_a_start_outside_the_window_reaches_nothing():
    sweeps = SweepMemory(1)
    sweeps.fit(40, 64)
    log_odds, closeness = np.full((40, 64), -20, np.int8), np.zeros((40, 64), np.uint16)
    passage = passage_of(BODIES[0], RESOLUTION, ClearanceField((40, 64), RESOLUTION, 0.6).limit)
    swept = costs_in(sweeps.table[0], (10, 20, 16, 32))
    prepare_costs(swept, log_odds, closeness, passage)
    for start in ((9, 20), (20, 20), (15, 15), (15, 32)):
        assert not spread_costs(swept, *start)
        assert (swept.costs == FAR).all()
    assert spread_costs(swept, 10, 31)
    assert (swept.costs < FAR).sum() == 160


def test_a_memory_serves_windows_one_after_the_other_and_copies_have_their_own():
    sweeps = SweepMemory(2)
    sweeps.fit(30, 64)
    before = sweeps.table.copy()
    sweeps.fit(30, 48)
    assert np.array_equal(sweeps.table, before)
    twin = copy.deepcopy(sweeps)
    assert twin.table.shape == sweeps.table.shape
    assert not (twin.table == sweeps.table).any()
    with pytest.raises(ValueError, match="40 columns; want a multiple of 16"):
        sweeps.fit(30, 40)


def test_a_map_of_many_blocks_is_swept_to_its_ends():
    shape = (5, 64 * LANES)
    log_odds = np.full(shape, -20, np.int8)
    log_odds[::2, 200:-200] = 20
    clearance = ClearanceField(shape, RESOLUTION, 0.6)
    clearance.update(log_odds)
    passage = passage_of(BODIES[1], RESOLUTION, clearance.limit)
    sweeps = SweepMemory(1)
    sweeps.fit(*shape)
    swept = costs_in(sweeps.table[0], (0, shape[0], 0, shape[1]))
    prepare_costs(swept, log_odds, clearance.closeness, passage)
    for start in ((1, 0), (3, shape[1] - 1), (3, 992)):
        assert spread_costs(swept, *start)
        expected = searched(log_odds, clearance, passage, start)[0]
        assert np.array_equal(swept.costs[1:-1, LANES:-LANES], expected)
