"""Levels of a map from the pixels of its picture."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

OCCUPIED, UNKNOWN, FREE = 0, 127, 255
_BLOCK_PIXELS = 1 << 20


def _shades(pixels: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of the colour channels in 0..255 and the opacity in 0..1."""
    scaled = pixels.astype(np.float64) * (255.0 / np.iinfo(pixels.dtype).max)
    if scaled.ndim == 2:
        return scaled, np.ones((1, 1))
    if scaled.shape[2] in (2, 4):
        return scaled[..., :-1].mean(axis=2), scaled[..., -1] / 255.0
    return scaled.mean(axis=2), np.ones((1, 1))


def levels_by_blocks(
    pixels: NDArray[Any], rule: Callable[[NDArray[np.float64]], NDArray[np.uint8]], sees_through: bool
) -> NDArray[np.uint8]:
    """Return the levels of pixels by a rule for shades, block by block, as shades take much memory.

    ``sees_through`` makes unknown what is not opaque.
    """
    levels = np.empty(pixels.shape[:2], np.uint8)
    rows = max(_BLOCK_PIXELS // max(pixels.shape[1], 1), 1)
    for row in range(0, len(pixels), rows):
        shades, opacity = _shades(pixels[row : row + rows])
        levels[row : row + rows] = rule(shades)
        if sees_through:
            levels[row : row + rows][np.broadcast_to(opacity < 1.0, shades.shape)] = UNKNOWN
    return levels


def levels_of(
    shades: NDArray[np.float64], *, negate: bool, low: float, high: float, unknown: int | None = None
) -> NDArray[np.uint8]:
    """Return the levels of shades in trinary mode: below and above the thresholds.

    ``unknown`` is a grey that stands for it whatever the thresholds.
    """
    occupancy = (shades if negate else 255.0 - shades) / 255.0
    levels = np.full(shades.shape, UNKNOWN, dtype=np.uint8)
    levels[occupancy > high] = OCCUPIED
    levels[occupancy < low] = FREE
    if unknown is not None:
        levels[np.abs(shades - unknown) < 0.5] = UNKNOWN
    return levels


def raw_levels(shades: NDArray[np.float64], low: float, high: float) -> NDArray[np.uint8]:
    """Read pixels as occupancy in percent; above 100 is unknown."""
    levels = np.full(shades.shape, UNKNOWN, dtype=np.uint8)
    levels[(shades > high * 100.0) & (shades <= 100.0)] = OCCUPIED
    levels[shades < low * 100.0] = FREE
    return levels
