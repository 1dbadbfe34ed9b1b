"""Points to quantise, and exhaustive search."""

import numpy as np

from lidarium.mapping.kernels.simd.codes import TILE


def room(count=3000, seed=0):
    """Return points on the floor and two walls of a room, with some noise, (count, 3) float32."""
    generator = np.random.default_rng(seed)
    points = generator.uniform(0.0, (6.0, 5.0, 3.0), (count, 3))
    points[np.arange(count), generator.integers(0, 3, count)] = 0.0
    return (points + generator.normal(0.0, 0.01, (count, 3))).astype(np.float32)


def searched(points, codes):
    """Return labels and squared distances of an exhaustive search in float32, of equal ones the first."""
    across = points[:, None].astype(np.float32) - codes[None].astype(np.float32)
    x, y, z = np.moveaxis(across * across, 2, 0)
    squares = (x + y) + z
    return squares.argmin(axis=1), squares.min(axis=1)


def in_order(values, tiles):
    """Return values of tiles in the caller's order."""
    flat = values.reshape(-1, TILE).reshape(-1)[: len(tiles.order)]
    placed = np.empty_like(flat)
    placed[tiles.order] = flat
    return placed
