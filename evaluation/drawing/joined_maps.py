"""Draws the maps of a team over each other, with their owners and their merges."""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lidarium.envs.drawing.frame_parts import EXPLORED, WALL, Colour, Frame, pale

Shades = tuple[Colour, Colour]
"""Colours of occupied and of free cells."""


def shades_of(group: Collection[int], colours: Sequence[Colour]) -> Shades:
    """Return the shades of a group's map: those of a robot alone are its own, joined maps are white."""
    if len(group) > 1:
        return WALL, EXPLORED
    (robot,) = group
    return colours[robot], pale(colours[robot])


def overlaid(picture: Frame, maps: Sequence[NDArray[np.signedinteger[Any]]], shades: Sequence[Shades]) -> Frame:
    """Return a picture with maps over it; if several know a cell, their shades are mixed evenly.

    Parameters
    ----------
    picture : (rows, columns, 3) uint8
        Background for unknown cells.
    maps : sequence of (rows, columns) int
        Above 0 if occupied, below if free, 0 if unknown.

    Returns
    -------
    (rows, columns, 3) uint8
        The caller's own.
    """
    mixed = picture.astype(np.float32)
    layers = np.zeros((*picture.shape[:2], 1), np.float32)
    for cells, (occupied, free) in zip(maps, shades, strict=True):
        levels = np.sign(cells)
        shown, is_known = np.array([(0, 0, 0), occupied, free], np.float32)[levels], (levels != 0)[..., None]
        mixed = np.where(is_known, (layers * mixed + shown) / (layers + 1.0), mixed)
        layers += is_known
    return mixed.astype(np.uint8)
