"""Costs of 16 cells at once are those of one cell after the other."""

import numpy as np
import pytest

from lidarium.mapping.kernels.compilation import kernel
from lidarium.mapping.kernels.in_python import plain_forms
from lidarium.mapping.kernels.lanes.cost_lanes import (
    FAR,
    FITS,
    LANES,
    cheaper_cells,
    look_up_costs,
    relax_backwards,
    relax_forwards,
)

WIDTH = 3 * LANES


@kernel
def relaxed(addresses, at, beside, backwards):
    costs, straight, diagonal, kinds = addresses
    if backwards:
        return relax_backwards(costs, straight, diagonal, kinds, at, beside)
    return relax_forwards(costs, straight, diagonal, kinds, at, beside)


@kernel
def cheaper(costs, limit):
    return cheaper_cells(costs.ctypes.data, limit)


@kernel
def looked_up(addresses):
    look_up_costs(addresses[0], addresses[1], addresses[2], addresses[3], addresses[4], addresses[5])


def drawn_rows(generator):
    costs = generator.integers(0, 60_000, (2, WIDTH)).astype(np.int32)
    straight = generator.integers(2378, 9000, (2, WIDTH)).astype(np.int32)
    kinds = generator.choice(np.array([0, 1, 3, 7, 7, 7], np.uint8), (2, WIDTH))
    costs[(generator.random((2, WIDTH)) < 0.6) | (kinds & FITS == 0)] = FAR
    return costs, straight, (straight * 1.4142).astype(np.int32), kinds


@pytest.mark.parametrize("is_backward", [False, True])
@pytest.mark.parametrize("row", [0, 1])
def test_costs_are_lowered_as_cell_by_cell(is_backward, row):
    generator = np.random.default_rng(0)
    lowered = 0
    for _ in range(200):
        costs, *rest = drawn_rows(generator)
        plain = costs.copy()
        at, beside = row * WIDTH + LANES, (1 - row) * WIDTH + LANES
        form = plain_forms.relax_backwards if is_backward else plain_forms.relax_forwards
        expected = form(*(grid.ctypes.data for grid in (plain, *rest)), at, beside)
        addresses = tuple(grid.ctypes.data for grid in (costs, *rest))
        assert relaxed(addresses, at, beside, is_backward) == expected
        assert np.array_equal(costs, plain)
        lowered += expected.bit_count()
    assert lowered > 500


def test_cheaper_cells_are_those_below_the_limit():
    costs = np.random.default_rng(0).integers(0, FAR, LANES).astype(np.int32)
    for limit in (0, int(costs[5]), FAR + 1):
        assert cheaper(costs, limit) == sum(1 << k for k in range(LANES) if costs[k] < limit)


def test_costs_are_looked_up_as_cell_by_cell():
    generator = np.random.default_rng(0)
    length, roomy, tight, plain = 60, 40, 50, 20
    table = generator.integers(2378, 9000, (2, length)).astype(np.int32)
    table[:, : plain + 1] = table[:, :1]
    body = np.array([table.ctypes.data, length, plain, tight, roomy])
    for farthest in (length, plain, roomy, 1):
        log_odds = generator.choice(np.array([-20, 0, 20], np.int8), LANES, p=[0.8, 0.1, 0.1])
        closeness = generator.integers(0, farthest, LANES).astype(np.uint16)
        results = []
        for function in (plain_forms.look_up_costs, lambda *given: looked_up(given)):
            kinds, straight, diagonal = (np.zeros(LANES, kind) for kind in (np.uint8, np.int32, np.int32))
            grids = (log_odds, closeness, body, kinds, straight, diagonal)
            function(*(grid.ctypes.data for grid in grids))
            results.append((kinds, straight, diagonal))
        for found, expected in zip(results[1], results[0], strict=True):
            assert np.array_equal(found, expected)
        fits = (log_odds < 0) & (closeness <= tight)
        assert np.array_equal(results[0][0] & FITS != 0, fits)
        assert np.array_equal(results[0][1], np.where(fits, table[0, closeness], 0))
        assert np.array_equal(results[0][2], np.where(fits, table[1, closeness], 0))
