"""The predictor that the package has: a trained network on windows of a map."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.prediction.levels import OCCUPIED, SIDE
from lidarium.mapping.prediction.network import WINDOW, MapNetwork, load_weights
from lidarium.mapping.prediction.predictors import PartialMap
from lidarium.mapping.prediction.windows import WindowedPrediction

TOLERANCE = 0.1
"""Squares that differ from the network's by no more than this share are taken as they are."""


class NetworkPredictor:
    """Predicts by a trained network.

    Parameters
    ----------
    weights : str or Path, optional
        File of its weights; those of the package by default.
    """

    def __init__(self, weights: str | Path = "") -> None:
        self._model = MapNetwork(load_weights(weights))
        self._maps: dict[str, WindowedPrediction] = {}

    def reset(self, team: Any) -> None:  # noqa: ANN401
        """Forget the maps of the episode before."""
        self._maps = {}

    def predict(self, partial: PartialMap) -> NDArray[np.float32]:
        """Return the probability that each square is free."""
        known = self._maps.setdefault(partial.agent, WindowedPrediction(self._model, WINDOW))
        scale = partial.side / SIDE
        if abs(scale - 1.0) <= TOLERANCE:
            return known(partial.levels)
        rows, columns = partial.levels.shape
        shape = max(round(rows * scale), 1), max(round(columns * scale), 1)
        found = known(_resampled(partial.levels, shape))
        return found[np.ix_(_centres(rows, shape[0]), _centres(columns, shape[1]))]


def _resampled(levels: NDArray[np.int8], shape: tuple[int, int]) -> NDArray[np.int8]:
    """Return levels as squares of another size: those with a part of a wall are occupied."""
    resampled = levels[np.ix_(_centres(shape[0], levels.shape[0]), _centres(shape[1], levels.shape[1]))]
    # Walls that are in the middle of no square must not be lost.
    ranges = []
    for index, count, size in zip(np.nonzero(levels == OCCUPIED), shape, levels.shape, strict=True):
        first, last = index * count // size, ((index + 1) * count - 1) // size
        most = int((last - first).max(initial=0))
        ranges.append([np.minimum(first + k, last) for k in range(most + 1)])
    for rows, columns in itertools.product(*ranges):
        resampled[rows, columns] = OCCUPIED
    return resampled


def _centres(count: int, size: int) -> NDArray[np.int64]:
    """Return the index among ``size`` squares of the middle of each of ``count`` that cover the same length."""
    return np.minimum(((np.arange(count) + 0.5) * size / count).astype(np.int64), size - 1)
