"""Shortcuts of a path: what can be driven straight is driven straight."""

import math
from typing import Any

import numpy as np

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.swept_body import BoxIndex, is_free

PULLS = 3
"""How often the corners of a path are pulled tight."""

PULL_STEPS = 5
"""Halvings in search of how far a corner can be pulled."""


@kernel
def shortened(index: BoxIndex, path: Array, body: Array) -> Any:  # noqa: ANN401
    """Shorten a path of straight segments that a body can be driven along.

    From each point on the path goes straight to the farthest point that it can reach. Then corners are pulled
    towards the straight line between their neighbours, as far as the body goes.

    Parameters
    ----------
    index : BoxIndex
        What stands there.
    path : (P, 3) float64
        Points of the path [m].
    body : (3,) float64
        ``SweptBody.numbers``.

    Returns
    -------
    (Q, 3) float64
        Points of the shorter path; it begins and ends where the other does.
    """
    points = _skipped(index, path, body)
    for _ in range(PULLS):
        if points.shape[0] < 3:
            break
        _pull(index, points, body)
        points = _skipped(index, points, body)
    return points


@kernel
def _skipped(index: BoxIndex, path: Array, body: Array) -> Array:
    """Leave out points between two others that see each other."""
    count = path.shape[0]
    kept, found = np.empty((count, 3)), 0
    place = 0
    while place < count:
        kept[found] = path[place]
        found += 1
        if place == count - 1:
            break
        # Twice as far each time, then between: most tests are of what is near.
        reach, step = 1, 1
        while place + reach + step < count and is_free(index, path[place], path[place + reach + step], body):
            reach += step
            step *= 2
        while step > 0:
            farther = place + reach + step
            if farther < count and is_free(index, path[place], path[farther], body):
                reach += step
            step //= 2
        place += reach
    return kept[:found]


@kernel
def _pull(index: BoxIndex, points: Array, body: Array) -> None:
    """Move inner points towards the line between their neighbours, as far as the body can be driven."""
    middle = np.empty(3)
    for k in range(1, points.shape[0] - 1):
        before, here, after = points[k - 1], points[k], points[k + 1]
        run, gap, squared = 0.0, 0.0, 0.0
        for axis in range(3):
            run = after[axis] - before[axis]
            squared += run * run
            gap += (here[axis] - before[axis]) * run
        share = min(max(gap / squared, 0.0), 1.0) if squared > 0.0 else 0.0
        low, high = 0.0, 1.0
        for _ in range(PULL_STEPS):
            part = 0.5 * (low + high)
            for axis in range(3):
                foot = before[axis] + share * (after[axis] - before[axis])
                middle[axis] = here[axis] + part * (foot - here[axis])
            if is_free(index, before, middle, body) and is_free(index, middle, after, body):
                low = part
            else:
                high = part
        for axis in range(3):
            foot = before[axis] + share * (after[axis] - before[axis])
            points[k, axis] = here[axis] + low * (foot - here[axis])


@kernel
def path_length(path: Array) -> float:
    """Return the length of a path (P, 3) [m]."""
    total = 0.0
    for k in range(1, path.shape[0]):
        gap = path[k] - path[k - 1]
        total += math.sqrt(gap[0] * gap[0] + gap[1] * gap[1] + gap[2] * gap[2])
    return total
