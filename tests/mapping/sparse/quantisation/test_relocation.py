"""Codes are exchanged from where they are crowded."""

import numpy as np

from lidarium.mapping.sparse.quantisation.lloyd import nearest_codes
from lidarium.mapping.sparse.quantisation.relocation import exchanged, merging_costs
from lidarium.mapping.sparse.quantisation.summary import summary_of
from lidarium.mapping.sparse.quantisation.tiles import tiles_of


def test_exchanges_take_from_where_codes_are_crowded():
    crowd = np.random.default_rng(0).normal(0.0, 0.01, (400, 3))
    spread = np.random.default_rng(1).uniform((5, 0, 0), (9, 4, 0), (400, 3))
    tiles = tiles_of(np.concatenate([crowd, spread]).astype(np.float32))
    codes = np.array([[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [7, 2, 0]], np.float32)
    summary = summary_of(tiles, codes, nearest_codes(tiles, codes))
    costs, partners = merging_costs(codes, summary.masses)
    assert (partners[:3] < 3).all()
    assert costs[3] > costs[:3].max()
    moved = exchanged(codes, summary, 1)
    assert (moved[:, 0] > 5).sum() == 2
    assert nearest_codes(tiles, moved).group_errors.sum() < 0.8 * summary.errors[:, 1].sum()
