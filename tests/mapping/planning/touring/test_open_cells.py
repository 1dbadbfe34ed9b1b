"""Coarse cells in which a body may stand."""

import math
from collections import namedtuple

import numpy as np
import pytest

from lidarium.mapping.planning.clearance import ClearanceField, limit_of
from lidarium.mapping.planning.footprint import Footprint
from lidarium.mapping.planning.grid_planning import search
from lidarium.mapping.planning.search.path_search import SearchSpace
from lidarium.mapping.planning.touring.open_cells import Standing, open_cells

CoarseGrid = namedtuple("CoarseGrid", "is_open factor row column side")


def coarse_grid(log_odds, field, radius, starts=()):
    """Return the open coarse cells of 0.1 m around all that is free, of bodies that start there."""
    factor = max(round(0.1 / field.resolution), 1)
    standing = Standing(factor, field.limit - limit_of(radius, field.resolution), round(0.2 / field.resolution))
    is_open = np.zeros([-(-side // factor) + 2 for side in log_odds.shape], np.uint8)
    window = np.array([0, log_odds.shape[0], 0, log_odds.shape[1]])
    starts = np.array(starts, np.int64).reshape(-1, 2)
    low, high, left, right = open_cells(log_odds, field.closeness, window, starts, standing, is_open)
    inside = is_open[low + 1 : high + 1, left + 1 : right + 1].astype(bool)
    assert inside.sum() == is_open.sum()
    return CoarseGrid(inside, factor, low * factor, left * factor, factor * field.resolution)


def drawn_map(seed, shape=(90, 120)):
    generator = np.random.default_rng(seed)
    log_odds = np.full(shape, -20, np.int8)
    for _ in range(25):
        row, column = generator.integers(0, shape[0] - 8), generator.integers(0, shape[1] - 8)
        height, width = (2, 20) if generator.random() < 0.5 else (20, 2)
        log_odds[row : row + height, column : column + width] = 20
    log_odds[:, :5] = 0
    field = ClearanceField(shape, 0.05, 0.6)
    field.update(log_odds)
    return log_odds, field


def test_a_cell_is_open_where_the_body_may_stand_in_it():
    log_odds, field = drawn_map(7)
    grid = coarse_grid(log_odds, field, 0.18)
    clearance = field.values() if hasattr(field, "values") else None
    may_stand = np.zeros(log_odds.shape, bool)
    occupied = np.argwhere(log_odds > 0)
    for row, column in np.argwhere(log_odds < 0):
        gaps = np.maximum(np.abs(occupied - (row, column)) - 0.5, 0.0) * 0.05
        may_stand[row, column] = np.hypot(*gaps.T).min() >= 0.18 - 1e-9
    rows, columns = grid.is_open.shape
    for row in range(rows):
        for column in range(columns):
            r, c = grid.row + row * grid.factor, grid.column + column * grid.factor
            assert grid.is_open[row, column] == may_stand[r : r + grid.factor, c : c + grid.factor].any()
    assert clearance is None or clearance.shape == log_odds.shape


def test_a_map_without_anything_known_has_one_closed_cell():
    log_odds = np.zeros((10, 10), np.int8)
    grid = coarse_grid(log_odds, ClearanceField(log_odds.shape, 0.05, 0.6), 0.18)
    assert not grid.is_open.any()
    assert math.isclose(grid.side, 0.1)


def test_what_the_fine_cells_do_not_join_is_left_out():
    log_odds = np.full((60, 120), -20, np.int8)
    log_odds[:, 60] = 20
    field = ClearanceField(log_odds.shape, 0.05, 0.6)
    field.update(log_odds)
    both = coarse_grid(log_odds, field, 0.18)
    left = coarse_grid(log_odds, field, 0.18, starts=np.array([[30, 20]]))
    assert (left.is_open[:, :28] == both.is_open[:, :28]).all()
    assert left.is_open[:, :28].any()
    assert not left.is_open[:, 30:].any()
    assert both.is_open[:, 30:].any()
    # A start in a wall joins what fits beside it; far from all that fits nothing is left out.
    assert coarse_grid(log_odds, field, 0.18, starts=np.array([[30, 60]])).is_open.sum() == both.is_open.sum()


@pytest.mark.parametrize("radius", [0.012, 0.12, 0.25])
def test_cells_are_joined_as_the_path_planner_joins_them(radius):
    """A body that fits between the corners of two cells does not fit past them."""
    generator = np.random.default_rng(3)
    log_odds = np.full((40, 60), -20, np.int8)
    log_odds[generator.random(log_odds.shape) < 0.3] = 0
    log_odds[generator.random(log_odds.shape) < (0.2 if radius < 0.1 else 0.03)] = 20
    log_odds[18:23, 28:33] = -20
    field = ClearanceField(log_odds.shape, 0.2, 0.6)
    field.update(log_odds)
    found = search(
        SearchSpace(log_odds.shape, 0.2), log_odds, field, (20, 30), Footprint(radius, max(radius, 0.16), 3.0)
    )
    grid = coarse_grid(log_odds, field, radius, starts=np.array([[20, 30]]))
    is_open = np.zeros(log_odds.shape, bool)
    is_open[grid.row : grid.row + len(grid.is_open), grid.column : grid.column + grid.is_open.shape[1]] = grid.is_open
    reached = np.isfinite([[found.cost((row, column)) for column in range(60)] for row in range(40)])
    assert 25 < reached.sum() < (log_odds < 0).sum()
    np.testing.assert_array_equal(is_open, reached)
