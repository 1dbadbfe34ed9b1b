"""Plain definitions of the vector operations: what each does, one number at a time or by numpy.

Tests compare the operations with them. Blocks are arrays here, and addresses there.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.vectors import LEVELS

Array = NDArray[Any]
Levels = NDArray[np.uint8]


def bits_of(cells: Array) -> int:
    """Return a word with a bit for each cell that is true, bit 0 the first."""
    return sum(1 << int(place) for place in np.flatnonzero(cells))


def cells_of(word: int, count: int = 64) -> NDArray[np.bool_]:
    """Return which of the first bits of a word are set, (count,)."""
    return np.array([word >> place & 1 for place in range(count)], bool)


def first_bit(word: int) -> int:
    """Return the place of the first bit that is set."""
    return next(place for place in range(64) if word >> place & 1)


def running_xor(word: int) -> int:
    """Return the running exclusive-or of a word's bits."""
    return bits_of(np.cumsum(cells_of(word)) % 2)


def update_block(
    old: Array, seen: int, hits: int, steps: tuple[int, int], bounds: tuple[int, int]
) -> tuple[NDArray[np.int8], int]:
    """Return log-odds lowered where seen, raised where hit, and the cells with another sign."""
    (hit, miss), (least, greatest) = steps, bounds
    lowered = np.maximum(np.clip(old.astype(int) - miss, -128, 127), least)
    raised = np.minimum(np.clip(old.astype(int) + hit, -128, 127), greatest)
    new = np.where(cells_of(hits), raised, np.where(cells_of(seen), lowered, old)).astype(np.int8)
    return new, bits_of(np.sign(new) != np.sign(old))


def sum_blocks(first: Array, second: Array) -> NDArray[np.int8]:
    """Return the sum of two blocks, clipped to [-127, 127]."""
    return np.asarray(np.clip(first.astype(int) + second, -127, 127), np.int8)


def greatest_of_groups(rows: Array, least: int, halvings: int) -> NDArray[np.int8]:
    """Return the greatest of all rows, in groups of ``2 ** halvings`` columns, and of ``least``."""
    return np.asarray(np.maximum(rows.max(axis=0).reshape(-1, 2**halvings).max(axis=1), least), np.int8)


def levels_of(log_odds: Array) -> Levels:
    """Return cells as levels: occupied where positive, unknown at zero, free where negative."""
    occupied, unknown, free = LEVELS
    return np.where(log_odds > 0, occupied, np.where(log_odds < 0, free, unknown)).astype(np.uint8)


def count_rows(rows: Array, steps: Array, largest: int) -> NDArray[np.uint16]:
    """Return for each row how many rows ago each column was occupied, at most ``largest``."""
    counted = []
    for row in rows:
        steps = np.where(row > 0, 0, np.minimum(steps + 1, largest))
        counted.append(steps)
    return np.array(counted, np.uint16)


def squares_of(steps: Array, far: int, cap: int) -> NDArray[np.uint16]:
    """Return the squared distances [half cells] after steps; ``cap`` from ``far`` steps on."""
    squares = np.minimum(np.maximum(2 * steps.astype(int) - 1, 0) ** 2, cap)
    return np.where(steps < far, squares, cap).astype(np.uint16)


def least_sums(numbers: Array, costs: Array, cap: int) -> NDArray[np.uint16]:
    """Return ``cap`` less the least of ``numbers[j + k] + costs[k]`` for 64 cells j."""
    sums = [numbers[k : k + 64].astype(int) + int(cost) for k, cost in enumerate(costs)]
    return np.asarray(cap - np.minimum(np.min(sums, axis=0), cap), np.uint16)


def same_cells(block: Array, other: Array) -> int:
    """Return in which cells two blocks are the same, and not 0."""
    return bits_of((block == other) & (other != 0))


def lower_ranges(
    ranges: Array, inverses: Array, directions: Array, distance: float, span: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Return ranges lowered where a beam meets a face at ``distance``, from low to high along its run."""
    run, low, high = span
    lowered = ranges.copy()
    for beam, nearest in enumerate(ranges):
        candidate = distance * inverses[beam]
        if low <= run + candidate * directions[beam] <= high and 0.0 < candidate < nearest:
            lowered[beam] = candidate
    return lowered


def crop_block(rows: Array, places: Array) -> Levels:
    """Return the 8 x 8 levels of the cells at some places, 16 * row + column, of loaded rows."""
    return levels_of(rows.reshape(-1)[places]).reshape(8, 8)


def raised_pixels(pixels: Array, start: float, slope: float, first: int, last: int) -> NDArray[np.float32]:
    """Return pixels, those from ``first`` to ``last`` at least ``start + slope * place``."""
    places = np.arange(len(pixels))
    new = np.float32(start) + np.float32(slope) * places.astype(np.float32)
    is_within = (first <= places) & (places <= last)
    return np.where(is_within & (new > pixels), new, pixels).astype(np.float32)


def nearest_codes(
    points: Array, codes: Array, numbers: Array, before: tuple[Array, Array]
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return squared distances (64,) and numbers of the nearest codes of points (3, 64).

    Of equal codes the first counts.

    ``before`` are those of codes that came earlier.
    """
    nearest, chosen = before[0].copy(), before[1].copy()
    for code, number in zip(codes, numbers, strict=True):
        x, y, z = (points - code[:, None]) ** 2
        square = x + y + z
        is_nearer = square < nearest
        nearest, chosen = np.where(is_nearer, square, nearest), np.where(is_nearer, number, chosen)
    return nearest.astype(np.float32), chosen.astype(np.int32)


def end_of_ray(
    squares: Array, origin: tuple[float, float, float], direction: list[float], distance: float
) -> float:
    """Return where a ray that is free up to a distance enters a solid cell, or the reach.

    The squares (4, rows, columns) open from each cell into each quadrant. All in cells: the origin is x, y
    and the reach; the direction is x, y and their inverses.
    """
    *start, reach = origin
    along, inverse = direction[:2], direction[2:]
    step = [-1 if each < 0.0 else 1 for each in along]
    table = squares[(step[0] < 0) + 2 * (step[1] < 0)]
    cell = [int(start[k] + distance * along[k]) for k in range(2)]
    while distance < reach:
        side = int(table[cell[1], cell[0]])
        if side == 0:
            break
        last = [cell[k] + step[k] * (side - 1) for k in range(2)]
        borders = [(last[k] + (step[k] > 0) - start[k]) * inverse[k] for k in range(2)]
        left, crossed = (0, 1) if borders[0] <= borders[1] else (1, 0)
        distance = max(distance, borders[left])
        if distance < reach:
            place = int(start[crossed] + distance * along[crossed])
            low, high = sorted((cell[crossed], last[crossed]))
            cell[left], cell[crossed] = last[left] + step[left], min(max(place, low), high)
    return min(distance, reach)


def end_of_bundle(
    squares: Array, origin: tuple[float, float, float], outer: list[float], inside: float
) -> float:
    """Return how far the rays between two outer ones run through squares that hold them all.

    ``outer`` holds the direction x, y of the first and the last ray, and their least inverses, signed. They
    stop ``inside`` before the border of a square. All in cells.
    """
    *start, reach = origin
    step = [-1 if each < 0.0 else 1 for each in outer[:2]]
    table = squares[(step[0] < 0) + 2 * (step[1] < 0)]
    distance = 0.0
    while True:
        cells = [
            sorted((int(start[k] + distance * outer[k]), int(start[k] + distance * outer[2 + k])))
            for k in range(2)
        ]
        near = [cells[k][0 if step[k] > 0 else 1] for k in range(2)]
        side = int(table[near[1], near[0]])
        borders = [
            (near[k] + step[k] * (side - 1) + (step[k] > 0) - start[k]) * outer[4 + k] for k in range(2)
        ]
        leaving = min(borders) - inside
        if side <= max(high - low for low, high in cells) or leaving <= distance + 1.0:
            return distance
        distance = leaving
        if distance >= reach:
            return distance
