"""Prediction of maps of any size by overlapping windows; only those that changed are predicted again."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.prediction.levels import UNKNOWN

STRIDE, SNAP, MARGIN = 80, 16, 30
"""Squares from one window to the next; windows begin at multiples of the second; so far beyond what is known squares
are predicted, if that takes several windows."""

LEAST_WEIGHT = 0.02
"""Weight of a window at its rim; it is 1 in its middle, where most around a square is seen."""

Model = Callable[[NDArray[np.int8]], NDArray[np.float32]]
"""Returns the probabilities of a window of levels, both (side, side)."""


class WindowedPrediction:
    """Predictions of one map as it grows.

    Parameters
    ----------
    model : callable
        Predicts a window.
    side : int
        Squares along a window.

    Attributes
    ----------
    predicted : int
        Number of windows that the model has predicted.
    """

    def __init__(self, model: Model, side: int) -> None:
        self._model, self._side = model, side
        ramp = np.minimum(np.arange(side) + 0.5, side - np.arange(side) - 0.5) / (0.5 * side)
        self._weights = np.maximum(np.minimum.outer(ramp, ramp), LEAST_WEIGHT).astype(np.float32)
        self._kept: dict[tuple[int, int], tuple[bytes, NDArray[np.float32]]] = {}
        self.predicted = 0

    def __call__(self, levels: NDArray[np.int8]) -> NDArray[np.float32]:
        """Return the probability that each square is free, (rows, columns) float32; 0 outside all windows.

        Windows overlap by half, and squares in several have the mean of theirs, weighted by how central they are.
        """
        total = np.zeros(levels.shape, np.float32)
        weights = np.zeros(levels.shape, np.float32)
        kept: dict[tuple[int, int], tuple[bytes, NDArray[np.float32]]] = {}
        for row, column in self._begins(levels):
            window = _cut(levels, row, column, self._side)
            if not (window != UNKNOWN).any():
                continue
            content = window.tobytes()
            found = self._kept.get((row, column))
            if found is None or found[0] != content:
                found = content, self._model(window)
                self.predicted += 1
            kept[row, column] = found
            inside, part = _overlap(levels.shape, row, column, self._side)
            total[inside] += found[1][part] * self._weights[part]
            weights[inside] += self._weights[part]
        self._kept = kept
        return np.divide(total, weights, out=np.zeros_like(total), where=weights > 0.0)

    def _begins(self, levels: NDArray[np.int8]) -> list[tuple[int, int]]:
        """Return the first square of each window; windows cover the known squares and a margin (see `_along`)."""
        is_known = levels != UNKNOWN
        if not is_known.any():
            return []
        axes = []
        for axis in (1, 0):
            known = np.flatnonzero(is_known.any(axis=axis))
            size = is_known.shape[1 - axis]
            axes.append(_along(int(known[0]), int(known[-1]) + 1, size, self._side))
        return [(row, column) for row in axes[0] for column in axes[1]]


def _along(low: int, high: int, size: int, side: int) -> list[int]:
    """Return where windows begin along an axis of which [low, high) is known: one window if it is enough.

    If almost a whole window is known, squares next to it may lie beyond the window, and so may up to 7 known ones at
    the high end. Several windows there, with the whole margin, made tours longer (docs/results/prediction.md).
    """
    if high - low <= side - SNAP:
        # Where the map is no larger, the window does not move with what is known.
        middle = size if size <= side - SNAP else low + high
        return [(middle // 2 - side // 2) // SNAP * SNAP]
    first = max(low - MARGIN, -MARGIN) // SNAP * SNAP
    last = min(high, size) + MARGIN - side
    count = -(-(last - first) // STRIDE) + 1
    return [first + k * STRIDE for k in range(max(count, 1))]


def _overlap(
    shape: tuple[int, ...], row: int, column: int, side: int
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the part of a grid that a window covers, and the part of the window."""
    inside, part = [], []
    for begin, size in ((row, shape[0]), (column, shape[1])):
        low, high = max(begin, 0), min(begin + side, size)
        inside.append(slice(low, max(high, low)))
        part.append(slice(low - begin, max(high, low) - begin))
    return (inside[0], inside[1]), (part[0], part[1])


def _cut(levels: NDArray[np.int8], row: int, column: int, side: int) -> NDArray[np.int8]:
    """Return a window of a grid, unknown beyond it."""
    window = np.full((side, side), UNKNOWN, np.int8)
    inside, part = _overlap(levels.shape, row, column, side)
    window[part] = levels[inside]
    return window
