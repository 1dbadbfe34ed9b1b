"""Floors of rooms and tunnels, drawn by a seed: what planners are often compared on, and no building looks like."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor

PIXEL_M = 0.1
"""Side of a pixel of the drawing [m]."""

SIDES_M, ROOMS, ROOM_M, TUNNEL_M = (25.0, 55.0), (4, 16), (2.5, 11.0), (1.0, 2.6)
"""Least and greatest side of a floor, number of rooms, side of a room, and width of a tunnel."""


def draw_dungeon(seed: int) -> Floor:
    """Return the floor of a seed: rooms, each joined to an earlier one by a tunnel with a bend."""
    generator = np.random.default_rng([seed, 11])
    rows, columns = (round(side / PIXEL_M) for side in generator.uniform(*SIDES_M, 2))
    is_free = np.zeros((rows, columns), np.bool_)
    middles: list[NDArray[np.int64]] = []
    for _ in range(int(generator.integers(*ROOMS))):
        size = np.round(generator.uniform(*ROOM_M, 2) / PIXEL_M).astype(np.int64)
        low = generator.integers(5, np.maximum(np.array([rows, columns]) - size - 5, 6))
        high = np.minimum(low + size, np.array([rows, columns]) - 5)
        is_free[low[0] : high[0], low[1] : high[1]] = True
        if generator.random() < 0.3:  # a pillar
            middle, half = (low + high) // 2, np.maximum(size // 8, 2)
            is_free[middle[0] - half[0] : middle[0] + half[0], middle[1] - half[1] : middle[1] + half[1]] = False
        place = generator.integers(low + 2, np.maximum(high - 2, low + 3))
        for other in range(1 + int(generator.random() < 0.35)):
            if len(middles) > other:
                _dig(is_free, place, middles[-1 - int(generator.integers(0, min(len(middles), 3)))], generator)
        middles.append(place)
    floor = load_floor(np.where(is_free, np.uint8(255), np.uint8(0)), PIXEL_M)
    return replace(floor, name=f"dungeon of seed {seed}")


def _dig(
    is_free: NDArray[np.bool_], start: NDArray[np.int64], end: NDArray[np.int64], generator: np.random.Generator
) -> None:
    """Dig a tunnel from one place to another, with one bend."""
    width = round(generator.uniform(*TUNNEL_M) / PIXEL_M)
    corner = (start[0], end[1]) if generator.random() < 0.5 else (end[0], start[1])
    for first, last in ((start, corner), (corner, end)):
        rows, columns = sorted((int(first[0]), int(last[0]))), sorted((int(first[1]), int(last[1])))
        half = width // 2
        is_free[
            max(rows[0] - half, 3) : min(rows[1] - half + width, is_free.shape[0] - 3),
            max(columns[0] - half, 3) : min(columns[1] - half + width, is_free.shape[1] - 3),
        ] = True
