"""The unknown area along 32 rays at once is that of one ray after the other."""

import numpy as np
from both_forms import assert_forms_agree

from lidarium.mapping.kernels.simd.sight import RAYS, unknown_in_view

SIDE, STEPS = 60, 24


def test_unknown_cells_are_summed_as_ray_by_ray():
    generator = np.random.default_rng(0)
    angles = (np.arange(RAYS) + 0.5) * (2.0 * np.pi / RAYS)
    along = np.arange(1, STEPS + 1)[:, None]
    rows, columns = (np.floor(0.5 + along * way).astype(int) for way in (np.sin(angles), np.cos(angles)))
    offsets = (rows * SIDE + columns).astype(np.int32)
    found = []
    for occupied in (0.0, 0.01, 0.1, 1.0):
        for unknown in (0.0, 0.2, 1.0):
            log_odds = np.full((SIDE, SIDE), -20, np.int8)
            log_odds[generator.random(log_odds.shape) < unknown] = 0
            log_odds[generator.random(log_odds.shape) < occupied] = 20
            cell = [log_odds, SIDE * (SIDE // 2) + SIDE // 2]
            found += [assert_forms_agree(unknown_in_view, cell, offsets, STEPS, most)[0] for most in (1, 8, STEPS)]
    assert found[6:9] == [RAYS * sum(range(1, most + 1)) for most in (1, 8, STEPS)]
    assert len(set(found)) > 15
    assert found[-1] == 0
