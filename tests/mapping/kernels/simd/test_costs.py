"""Costs of 16 cells at once are those of one cell after the other."""

import numpy as np
import pytest
from both_forms import assert_forms_agree

from lidarium.mapping.kernels.simd.costs import (
    FAR,
    FITS,
    LANES,
    cheaper_cells,
    look_up_costs,
    relax_backwards,
    relax_forwards,
)

WIDTH = 3 * LANES


def drawn_rows(generator):
    costs = generator.integers(0, 60_000, (2, WIDTH)).astype(np.int32)
    straight = generator.integers(2378, 9000, (2, WIDTH)).astype(np.int32)
    kinds = generator.choice(np.array([0, 1, 3, 7, 7, 7], np.uint8), (2, WIDTH))
    costs[(generator.random((2, WIDTH)) < 0.6) | (kinds & FITS == 0)] = FAR
    return costs, straight, (straight * 1.4142).astype(np.int32), kinds


@pytest.mark.parametrize("operation", [relax_forwards, relax_backwards])
@pytest.mark.parametrize("row", [0, 1])
def test_costs_are_lowered_as_cell_by_cell(operation, row):
    generator = np.random.default_rng(0)
    lowered = 0
    for _ in range(200):
        at, beside = row * WIDTH + LANES, (1 - row) * WIDTH + LANES
        lowered += assert_forms_agree(operation, *drawn_rows(generator), at, beside)[0].bit_count()
    assert lowered > 500


def test_cheaper_cells_are_those_below_the_limit():
    costs = np.random.default_rng(0).integers(0, FAR, LANES).astype(np.int32)
    for limit in (0, int(costs[5]), FAR + 1):
        found = assert_forms_agree(cheaper_cells, costs, limit)[0]
        assert found == sum(1 << k for k in range(LANES) if costs[k] < limit)


def test_costs_are_looked_up_as_cell_by_cell():
    generator = np.random.default_rng(0)
    length, roomy, tight, same = 60, 40, 50, 20
    table = generator.integers(2378, 9000, (2, length)).astype(np.int32)
    table[:, : same + 1] = table[:, :1]
    body = np.array([table.ctypes.data, length, same, tight, roomy])
    for farthest in (length, same, roomy, 1):
        log_odds = generator.choice(np.array([-20, 0, 20], np.int8), LANES, p=[0.8, 0.1, 0.1])
        closeness = generator.integers(0, farthest, LANES).astype(np.uint16)
        results = (np.zeros(LANES, dtype) for dtype in (np.uint8, np.int32, np.int32))
        *_, kinds, straight, diagonal = assert_forms_agree(look_up_costs, log_odds, closeness, body, *results)
        fits = (log_odds < 0) & (closeness <= tight)
        assert np.array_equal(kinds & FITS != 0, fits)
        assert np.array_equal(straight, np.where(fits, table[0, closeness], 0))
        assert np.array_equal(diagonal, np.where(fits, table[1, closeness], 0))
