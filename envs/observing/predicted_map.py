"""What is probably free around a robot, as the network that the package has predicts it from the robot's map."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lidarium.envs.observing.rows import Rows
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.settings.observables import Observable
from lidarium.mapping.prediction.levels import SIDE, factor_of, levels_of
from lidarium.mapping.prediction.network import WINDOW
from lidarium.mapping.prediction.predictors import PartialMap, make_predictor, predicted


def _squares(settings: ExplorationSettings) -> tuple[int, int]:
    """Return the number of squares along the observation, and of cells along a square."""
    resolution = settings.occupancy.resolution
    factor = factor_of(resolution)
    return max(round(WINDOW * SIDE / (factor * resolution)), 1), factor


def predicted_map(rows: Rows) -> NDArray[np.float32]:
    """Return the probability that each square within 16 m of each robot is free, (rows, side, side)."""
    side, factor = _squares(rows.settings)
    found = np.empty((rows.robots * rows.episodes, side, side), np.float32)
    predictor = make_predictor("network")
    for number, (log_odds, cell) in enumerate(zip(rows.log_odds, rows.map_cell, strict=True)):
        levels = levels_of(_around(log_odds, cell, side * factor), factor)
        prediction = predicted(predictor, PartialMap(levels, factor * rows.settings.occupancy.resolution))
        assert prediction is not None
        found[number] = prediction
    return found


def _around(log_odds: NDArray[np.int8], cell: NDArray[np.int64], side: int) -> NDArray[np.int8]:
    """Return a piece of a map around a cell, unknown beyond the map."""
    piece = np.zeros((side, side), np.int8)
    row, column = (int(value) - side // 2 for value in cell)
    part = log_odds[max(row, 0) : max(row + side, 0), max(column, 0) : max(column + side, 0)]
    top, left = max(-row, 0), max(-column, 0)
    piece[top : top + part.shape[0], left : left + part.shape[1]] = part
    return piece


def _box(settings: Any) -> spaces.Box:  # noqa: ANN401
    assert isinstance(settings, ExplorationSettings)
    side, _ = _squares(settings)
    return spaces.Box(0.0, 1.0, (side, side), np.float32)


PREDICTED_MAP = Observable(_box, compute=predicted_map)
