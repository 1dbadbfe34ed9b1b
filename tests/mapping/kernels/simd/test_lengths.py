"""Lengths from many places at once are those of one place after the other."""

import numpy as np
import pytest
from both_forms import assert_forms_agree

from lidarium.mapping.kernels.simd.lengths import (
    FAR,
    FEW_LANES,
    LANES,
    begin_with_bounds,
    lower_run,
    lower_run_of_few,
)


@pytest.mark.parametrize(("operation", "lanes"), [(lower_run, LANES), (lower_run_of_few, FEW_LANES)])
def test_runs_are_lowered_as_cell_by_cell(operation, lanes):
    generator = np.random.default_rng(0)
    lowered = 0
    for _ in range(40):
        count = int(generator.integers(1, 12))
        lengths = generator.integers(0, 200, (3 * count + 3, lanes)).astype(np.uint16)
        lengths[generator.random(lengths.shape) < 0.6] = FAR
        lengths[generator.random(lengths.shape) < 0.1] = FAR - 3
        lengths[0] = FAR
        numbers = generator.integers(0, count + 1, count + 2).astype(np.int32)
        first = count + 1
        changed, after, _ = assert_forms_agree(operation, lengths, numbers, first, count)
        assert changed == (after != lengths).any()
        lowered += changed
        for k in range(count - 1):
            along = np.abs(after[first + k].astype(int) - after[first + k + 1])
            assert (along <= 5).all()
    assert lowered > 20


def test_bounds_are_the_shortest_ways_past_hubs():
    generator = np.random.default_rng(1)
    known, to_hubs = (generator.integers(0, FAR, shape).astype(np.uint16) for shape in ((9, FEW_LANES), (3, LANES)))
    known[4:6], to_hubs[1] = FAR, generator.integers(0, 50, LANES)
    for hubs in (0, 1, 3):
        lengths = np.zeros((9, LANES), np.uint16)
        _, found, *_ = assert_forms_agree(begin_with_bounds, lengths, known, to_hubs, hubs, len(known))
        assert (found[[0, 4, 5]] == FAR).all()
        assert ((found < FAR).any()) == (hubs > 0)
