"""Beliefs with frontiers, for tests of what is searched for there."""

import numpy as np
from hypothesis import strategies as st

from lidarium.mapping.planning.clearance import ClearanceField
from lidarium.mapping.planning.frontiers.frontier_map import FrontierMap

RESOLUTION = 0.025


SEEDS = st.integers(0, 10**6)


def by_definition(belief):
    unknown = np.pad(belief == 0, 1)
    beside = unknown[:-2, 1:-1] | unknown[2:, 1:-1] | unknown[1:-1, :-2] | unknown[1:-1, 2:]
    return (belief < 0) & beside


def random_belief(seed, shape=(70, 80)):
    """Blobs of free floor with walls in them, unknown around."""
    random = np.random.default_rng(seed)
    belief = np.zeros(shape, np.int8)
    for value, count, size in ((-5, 7, 30), (9, 8, 12), (0, 3, 8)):
        for _ in range(count):
            row, column = random.integers(0, shape[0]), random.integers(0, shape[1])
            height, width = random.integers(1, size, size=2)
            if value == 9:
                height, width = (1, width) if random.random() < 0.5 else (height, 1)
            belief[row : row + height, column : column + width] = value
    return belief


def made(belief):
    field = ClearanceField(belief.shape, RESOLUTION)
    field.update(belief)
    frontiers = FrontierMap(belief.shape, RESOLUTION)
    frontiers.update(belief)
    return field, frontiers
