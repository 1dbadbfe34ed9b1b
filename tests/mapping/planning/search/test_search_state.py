"""The memory of a search: discs are closed, traces followed, and all is forgotten."""

import math

import numpy as np
import pytest
from searched_beliefs import made, open_start, random_belief

from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import search
from lidarium.mapping.planning.search.search_state import (
    COLUMN_BITS,
    COLUMN_STEPS,
    NO_ENTRY,
    ROW_SHIFT,
    ROW_STEPS,
    Targets,
    clear,
    close_discs,
    disc_spans,
    near_tiles,
    trace,
)


def test_discs_close_the_cells_whose_centres_lie_inside_once():
    remaining, touched = np.zeros((30, 40), np.int32), np.zeros(1200, np.int32)
    discs = np.array([(10.0, 12.0, 4.5), (12.5, 14.0, 3.0), (0.0, 39.0, 2.0), (-20.0, 5.0, 3.0)])
    count = close_discs(remaining, touched, discs)
    row, column = np.indices(remaining.shape)
    inside = np.any([(row - r) ** 2 + (column - c) ** 2 < radius**2 for r, c, radius in discs.tolist()], axis=0)
    np.testing.assert_array_equal(remaining == NO_ENTRY, inside)
    assert count == inside.sum()
    packed = touched[:count]
    assert {(cell >> ROW_SHIFT, cell & COLUMN_BITS) for cell in packed.tolist()} == set(
        map(tuple, np.argwhere(inside).tolist())
    )


def test_what_a_search_touched_is_forgotten():
    belief = random_belief(5)
    space, field = made(belief)
    footprint = Footprint(0.03, 0.1)
    search(space, belief, field, open_start(belief, footprint, 1), footprint)
    assert space.touched_count > 50
    clear(space.remaining, space.touched, space.touched_count)
    assert not space.remaining.any()


def test_a_trace_leads_from_the_start_step_by_step():
    parent = np.zeros((12, 12), np.uint8)
    cells = [(5, 5)]
    for direction in (0, 4, 2, 5, 1, 7, 3, 7, 6):
        row, column = cells[-1][0] + ROW_STEPS[direction], cells[-1][1] + COLUMN_STEPS[direction]
        parent[row, column] = direction
        cells.append((int(row), int(column)))
    assert len(set(cells)) == len(cells)
    assert trace(parent, 5, 5, *cells[-1]).tolist() == [list(cell) for cell in cells]
    assert trace(parent, 5, 5, 5, 5).tolist() == [[5, 5]]


@pytest.mark.parametrize("reach", [0.0, 0.9, 1.0, 2.5, math.sqrt(8.0), 7.0])
def test_a_disc_holds_the_cells_whose_centres_are_within_reach(reach):
    spans = disc_spans(reach)
    k = len(spans) // 2
    for row in range(-k - 1, k + 2):
        for column in range(-9, 10):
            is_held = abs(row) <= k and abs(column) <= spans[row + k]
            assert is_held == (math.hypot(row, column) <= reach + 1e-6)


def test_no_target_is_within_reach_of_a_tile_that_is_left_out():
    mask = np.random.default_rng(1).random((70, 90)) < 0.001
    for reach in (0.0, 3.0, 20.0):
        targets = Targets.of(mask, reach)
        assert targets.near.shape == (5, 6)
        for row, column in np.argwhere(targets.near == 0):
            cells = np.argwhere(np.ones((16, 16))) + np.array([16 * row, 16 * column])
            gaps = np.linalg.norm(cells[:, None] - np.argwhere(mask)[None], axis=2)
            assert gaps.min() > reach
        assert (targets.near == 0).any() or reach == 20.0


def test_other_values_of_a_mask_are_no_targets():
    mask = np.zeros((40, 40), np.uint8)
    mask[3, 3], mask[30, 30] = 2, 1
    assert Targets.of(mask).near.tolist() == [[0, 0, 0], [0, 1, 0], [0, 0, 0]]


def test_cells_are_targets_from_themselves():
    targets = Targets.at([(0, 0), (17, 33)], (20, 40))
    assert np.argwhere(targets.mask == 1).tolist() == [[0, 0], [17, 33]]
    assert targets.near.tolist() == [[1, 0, 0], [0, 0, 1]]
    assert targets.spans.tolist() == [0]


def test_near_tiles_end_with_the_grid():
    counts = np.zeros((3, 4), np.int32)
    counts[0, 0] = 5
    assert near_tiles(counts, 16.5).tolist() == [[1, 1, 1, 0], [1, 1, 1, 0], [1, 1, 1, 0]]
    assert near_tiles(counts, 0.0).sum() == 1
