"""Predictions of maps in files."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.files import map_files
from lidarium.mapping.files.map_files import MapImage
from lidarium.mapping.prediction.levels import FREE, OCCUPIED, UNKNOWN, factor_of, levels_of
from lidarium.mapping.prediction.predictors import PartialMap, Predictor, predicted

SURE = 0.65
"""Squares are free or occupied in a predicted map if they are so with this probability; others stay unknown."""


@dataclass(frozen=True, slots=True, eq=False)
class PredictedMap:
    """A map with what is probably behind its border.

    Attributes
    ----------
    levels : (rows, columns) int8
        What is known of each square: -1 free, 0 unknown, 1 occupied; row 0 at the lowest y.
    probability : (rows, columns) float32
        Probability that it is free; 1 and 0 where it is known.
    image : MapImage
        The map with unknown squares that are probably free or occupied as such.
    """

    levels: NDArray[np.int8]
    probability: NDArray[np.float32]
    image: MapImage


def predict_map(image: MapImage, predictor: Predictor, margin_m: float = 0.0) -> PredictedMap:
    """Predict a map that was read from a file.

    Parameters
    ----------
    image : MapImage
        The map.
    predictor : Predictor
        What predicts.
    margin_m : float, optional
        Predicted space around the map [m]; none by default.

    Raises
    ------
    ValueError
        If nothing in the map is free, or the predictor predicts nothing.
    """
    if not (image.levels == map_files.FREE).any():
        raise ValueError("the map has no free cell, so nothing can be predicted; want a map with some explored space")
    factor = factor_of(image.resolution)
    side = factor * image.resolution
    around = round(margin_m / side)
    log_odds = np.select([image.levels == map_files.FREE, image.levels == map_files.OCCUPIED], [-1, 1], 0)
    levels = np.pad(levels_of(log_odds.astype(np.int8), factor), around, constant_values=UNKNOWN)
    probability = predicted(predictor, PartialMap(levels, side))
    if probability is None:
        raise ValueError(f"{type(predictor).__name__} predicts nothing; want another predictor, such as 'network'")
    drawn = np.full(levels.shape, map_files.UNKNOWN, np.uint8)
    drawn[(levels == FREE) | ((levels == UNKNOWN) & (probability >= SURE))] = map_files.FREE
    drawn[(levels == OCCUPIED) | ((levels == UNKNOWN) & (probability <= 1.0 - SURE) & (probability > 0.0))] = (
        map_files.OCCUPIED
    )
    x, y, yaw = image.origin
    gap = -around * side
    corner = x + gap * (np.cos(yaw) - np.sin(yaw)), y + gap * (np.sin(yaw) + np.cos(yaw)), yaw
    return PredictedMap(levels, probability, MapImage(drawn, (float(corner[0]), float(corner[1]), yaw), side))
