"""Maps and their pooled forms, for tests of crops."""

import numpy as np

from lidarium.mapping.grids.map_crops import crop_turned
from lidarium.mapping.grids.occupancy import three_levels
from lidarium.mapping.grids.pooled_maps import pool_touched, touch, untouched


def random_map(seed, rows=40, columns=128):
    """A map in which most cells agree with their neighbours, so that pooled cells are of all levels."""
    generator = np.random.default_rng(seed)
    coarse = generator.integers(-1, 2, (-(-rows // 8), -(-columns // 8))).astype(np.int8) * np.int8(20)
    fine = np.kron(coarse, np.ones((8, 8), np.int8))[:rows, :columns]
    return np.where(
        generator.random((rows, columns)) < 0.03, generator.integers(-40, 71, (rows, columns)), fine
    ).astype(np.int8)


def pooled_levels(log_odds, scale):
    """Levels of the pooled cells; the least level of their cells wins, and what lies beyond the map is
    unknown."""
    rows, columns = (-(-size // scale) for size in log_odds.shape)
    padded = np.zeros((rows * scale, columns * scale), np.int8)
    padded[: log_odds.shape[0], : log_odds.shape[1]] = log_odds
    return three_levels(padded).reshape(rows, scale, columns, scale).min(axis=(1, 3))


def all_touched(log_odds):
    touched = untouched(*log_odds.shape)
    touch(touched, (0, log_odds.shape[0]), (0, log_odds.shape[1] // 64))
    return touched


def pools_of(log_odds, scales, touched):
    """Pooled maps from a blank start, and their table."""
    pools = [
        log_odds if scale == 1 else np.zeros([-(-size // scale) for size in log_odds.shape], np.int8)
        for scale in scales
    ]
    for scale, pooled in zip(scales, pools, strict=True):
        if scale > 1:
            pool_touched(log_odds, touched, scale, pooled)
    return pools, np.array([(pooled.ctypes.data, *pooled.shape) for pooled in pools], np.int64)


def crop(log_odds, row, column, heading, scales, cells, turn=crop_turned):
    crops = np.full((len(scales), cells, cells), 99, np.uint8)
    pools, table = pools_of(log_odds, scales, all_touched(log_odds))
    turn(table, float(column), float(row), heading, np.array(scales, np.int64), crops)
    assert pools
    return crops
