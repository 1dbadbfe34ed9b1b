"""A picture of a map and of the prediction beyond its border."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lidarium.envs.drawing.prediction_layer import tinted
from lidarium.evaluation.drawing.picture_parts import INK, box_around, rgb, save_titled_figure, show_cells
from lidarium.mapping.prediction.levels import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.prediction.whole_maps import PredictedMap

OUTSIDE = "#e5e7eb"
"""Colour of unknown squares that are probably not free."""

SHOWN = 0.05
"""Squares that are free with a smaller probability need not be in the picture."""


def save_prediction_picture(path: Path, found: PredictedMap, title: str) -> None:
    """Draw a predicted map: known space in white and black, unknown space the bluer the more probably it is free."""
    colours = coloured(found.levels, found.probability)
    side = found.image.resolution
    box = box_around((found.levels != UNKNOWN) | (found.probability > SHOWN), (0.0, 0.0), side)
    height = 8.0
    figure = Figure(figsize=(min(max(height * box.aspect, 5.0), 16.0), height + 0.8), layout="constrained")
    show_cells(figure.add_subplot(), colours[box.rows, box.columns], box, OUTSIDE)
    save_titled_figure(path, figure, title, "white is known to be free; blue is unknown and probably free")


def coloured(levels: NDArray[np.int8], probability: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the colours of squares, (rows, columns, 3) uint8."""
    colours = tinted(np.broadcast_to(rgb(OUTSIDE), (*levels.shape, 3)), probability)
    colours[levels == FREE] = 255
    colours[levels == OCCUPIED] = rgb(INK)
    return colours
