"""What the network of the package predicts beyond the maps of a team, and its colour in pictures."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import Colour, Frame
from lidarium.envs.settings.exploration import ExplorationSettings
from lidarium.envs.simulation.maps_on_floor import map_on_floor
from lidarium.envs.simulation.simulation import Simulation
from lidarium.mapping.prediction.levels import factor_of, levels_of
from lidarium.mapping.prediction.predictors import PartialMap, make_predictor, predicted

PREDICTED: Colour = (37, 99, 235)
"""Colour of unknown space that is surely free."""

STRENGTH = 0.6
"""Share of that colour in frames where unknown space is surely free: robots and paths stand out from it."""


def tinted(picture: Frame, shares: NDArray[np.floating[Any]]) -> Frame:
    """Return colours (..., 3), mixed with that of the prediction by shares (...) from 0 to 1."""
    mixed = picture + (np.array(PREDICTED) - picture) * np.asarray(shares)[..., None]
    return np.asarray(np.rint(mixed), np.uint8)


class PredictionLayer:
    """Predictions of maps as they grow; only what has changed is predicted again."""

    def __init__(self) -> None:
        self._predictor = make_predictor("network")

    def squares(
        self, log_odds: NDArray[np.signedinteger[Any]], resolution: float, name: str = ""
    ) -> tuple[NDArray[np.float32], int]:
        """Return the probability that each square of a map is free, 1 or 0 for known ones, and cells along a square.

        Maps of several names are remembered beside each other.
        """
        factor = factor_of(resolution)
        levels = levels_of(np.sign(log_odds).astype(np.int8), factor)
        found = predicted(self._predictor, PartialMap(levels, factor * resolution, name))
        assert found is not None
        return found, factor

    def cells(self, log_odds: NDArray[np.signedinteger[Any]], resolution: float, name: str = "") -> NDArray[np.float32]:
        """Return the same for each unknown cell of the map, 0 for known ones."""
        found, factor = self.squares(log_odds, resolution, name)
        rows, columns = log_odds.shape
        whole = np.repeat(np.repeat(found, factor, axis=0), factor, axis=1)[:rows, :columns]
        return np.where(log_odds == 0, whole, np.float32(0.0))

    def on_floor(self, simulation: Simulation, settings: ExplorationSettings, episode: int) -> NDArray[np.float32]:
        """Return the same for the sum of the maps of a team, on the lattice of the scorer's masks."""
        rows, words = simulation.score.counted_masks[episode].shape
        window, first = (slice(0, rows), slice(0, words * 64)), episode * settings.robots
        maps = [map_on_floor(simulation, settings, first + robot, *window) for robot in range(settings.robots)]
        together = np.asarray(np.sum(maps, axis=0, dtype=np.int16))
        return self.cells(together, settings.occupancy.resolution, str(episode))
