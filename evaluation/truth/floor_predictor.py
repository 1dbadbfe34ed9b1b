"""The floor itself in place of a prediction: the bound on what predictors can win."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.prediction.levels import free_squares
from lidarium.mapping.prediction.predictors import PartialMap


class FloorPredictor:
    """Predicts the truth; robots have to know their starts, so that the floor can be laid on their maps."""

    def reset(self, team: Any) -> None:  # noqa: ANN401
        """Begin an episode.

        Raises
        ------
        ValueError
            If starts are unknown.
        """
        if not team.settings.known_starts:
            raise ValueError("predictor 'truth' needs known starts; want known_starts=True or another predictor")
        self._team = team
        self._free: dict[str, NDArray[np.float32]] = {}

    def predict(self, partial: PartialMap) -> NDArray[np.float32]:
        """Return 1 for free squares, else 0."""
        if partial.agent not in self._free:
            self._free[partial.agent] = self._laid_on(partial)
        return self._free[partial.agent]

    def _laid_on(self, partial: PartialMap) -> NDArray[np.float32]:
        """Return the floor's free squares on the lattice of a robot's map."""
        belief = self._team.belief(partial.agent)  # that of the team itself, also within a supervisor
        perception, row = belief._perception, belief._row
        episode, beliefs = perception.episode_of(row), perception.beliefs
        laser = perception.world.floors[episode].laser
        counted = np.unpackbits(
            perception.simulation.score.counted_masks[episode].astype("<u8").view(np.uint8), axis=1, bitorder="little"
        ).astype(np.bool_)
        resolution = beliefs.occupancy.resolution
        multiple = round(resolution / laser.resolution)
        rows, columns = -(-laser.solid.shape[0] // multiple), -(-laser.solid.shape[1] // multiple)
        solid = np.zeros((rows * multiple, columns * multiple), np.bool_)
        solid[: laser.solid.shape[0], : laser.solid.shape[1]] = laser.solid != 0
        pooled = np.asarray(solid.reshape(rows, multiple, columns, multiple).any(axis=(1, 3)))
        gap = np.round((np.array(laser.origin) - beliefs.origins[row]) / resolution).astype(np.int64)
        shape = beliefs.log_odds[row].shape
        free = free_squares(
            _shifted(counted, shape, gap[::-1]), _shifted(pooled, shape, gap[::-1]), round(partial.side / resolution)
        )
        return free.astype(np.float32)


def _shifted(cells: NDArray[np.bool_], shape: tuple[int, int], gap: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return cells on a grid of another shape, at a gap (rows, columns) from its corner."""
    laid = np.zeros(shape, np.bool_)
    row, column = (int(value) for value in gap)
    part = cells[max(-row, 0) :, max(-column, 0) :]
    row, column = max(row, 0), max(column, 0)
    part = part[: shape[0] - row, : shape[1] - column]
    laid[row : row + part.shape[0], column : column + part.shape[1]] = part
    return laid
