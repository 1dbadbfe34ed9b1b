"""Lengths from many places at once against a plain search."""

import heapq

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.mapping.kernels.simd.lengths import FAR, FEW_LANES, LANES
from lidarium.mapping.planning.touring.many_lengths import (
    lengths_between,
    lengths_from_few,
    lengths_from_many,
    number_cells,
)


def lengths_by_heap(is_open, start):
    """Return lengths in fifths of a side, written plainly; the start counts as open."""
    columns = is_open.shape[1]
    lengths, heap = np.full(is_open.size, FAR, np.int64), [(0, start)]
    lengths[start] = 0
    while heap:
        length, cell = heapq.heappop(heap)
        if length > lengths[cell]:
            continue
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                other, further = cell + i * columns + j, length + (7 if i and j else 5)
                if is_open.ravel()[other] and further < lengths[other]:
                    lengths[other] = further
                    heapq.heappush(heap, (further, other))
    return lengths


def numbered(is_open):
    """Return the cells of a grid with its border, from a copy."""
    rows, columns = is_open.shape
    return number_cells(is_open.copy(), np.array([0, rows - 2, 0, columns - 2]), np.zeros(is_open.shape, np.int32))


@settings(deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.4, 0.6, 0.8, 0.97]))
def test_lengths_are_those_of_a_plain_search(seed, share):
    """Starts may be closed: then others do not reach them, and no path leads past them."""
    generator = np.random.default_rng(seed)
    rows, columns = (int(side) for side in generator.integers(1, 30, 2))
    is_open = np.zeros((rows + 2, columns + 2), np.uint8)
    is_open[1:-1, 1:-1] = generator.random((rows, columns)) < share
    inside = np.flatnonzero(np.pad(np.ones((rows, columns)), 1))
    robots = generator.choice(inside, int(generator.integers(1, 2 * FEW_LANES)))
    views = generator.choice(inside, int(generator.integers(1, LANES + 1)))
    cells = numbered(is_open)
    assert cells.total == is_open.sum() == cells.runs[:, 1].sum()
    few = lengths_from_few(cells, robots)
    many = lengths_from_many(cells, views, few[0], robots[:FEW_LANES])
    numbers, is_numbered = cells.numbers.ravel(), is_open.ravel() > 0
    for k, start in enumerate(robots):
        found = few[k // FEW_LANES, numbers, k % FEW_LANES]
        np.testing.assert_array_equal(found[is_numbered], lengths_by_heap(is_open, start)[is_numbered])
    for k, start in enumerate(views):
        np.testing.assert_array_equal(many[numbers, k][is_numbered], lengths_by_heap(is_open, start)[is_numbered])
    assert (few[:, 0] == FAR).all()
    assert (many[0] == FAR).all()


@settings(deadline=None)
@given(st.integers(0, 10**6), st.integers(1, LANES + 3), st.integers(1, 2 * FEW_LANES))
def test_lengths_between_places_are_those_of_a_plain_search(seed, starts, ends):
    generator = np.random.default_rng(seed)
    is_open = np.zeros((22, 17), np.uint8)
    is_open[1:-1, 1:-1] = generator.random((20, 15)) < 0.75
    inside = np.flatnonzero(is_open)
    starts, ends = generator.choice(inside, starts), generator.choice(inside, ends)
    found = lengths_between(is_open.copy(), starts, ends)
    np.testing.assert_array_equal(found, [lengths_by_heap(is_open, start)[ends] for start in starts])


def test_cells_are_numbered_row_by_row_and_the_grid_is_cleared():
    is_open = np.zeros((5, 8), np.uint8)
    is_open[1, 2:4], is_open[1, 6], is_open[3, 1:7] = 1, 1, 1
    numbers = np.zeros(is_open.shape, np.int32)
    cells = number_cells(is_open, np.array([0, 3, 0, 6]), numbers)
    assert numbers[1].tolist() == [0, 0, 1, 2, 0, 0, 3, 0]
    assert numbers[3].tolist() == [0, 4, 5, 6, 7, 8, 9, 0]
    assert cells.total == 9
    assert not is_open.any()


@pytest.mark.parametrize("length", [9000, 14000])
def test_paths_of_more_than_a_kilometre_count_as_none(length):
    is_open = np.zeros((3, length + 2), np.uint8)
    is_open[1, 1:-1] = 1
    few = lengths_from_few(numbered(is_open), np.array([length + 3]))
    assert few[0, 1:, 0].tolist() == [min(5 * k, FAR) for k in range(length)]
