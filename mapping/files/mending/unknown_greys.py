"""The grey that stands for unknown in a map's picture.

Thresholds of a header, or the middle of black and white, often call it free: nav2 writes unknown as 205 and a
``free_thresh`` of 0.25, and other mappers write 204, 206, 127 or 128. It stands alone: hardly any pixel has a
grey beside it, and what is free is brighter.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

MAP_SERVER_GREYS = range(204, 207)
MIDDLE_GREYS = range(126, 130)
ALONE = 10
"""So many times more pixels have the grey than the greys beside it."""

LEAST_SHARE = 1e-3
"""Least share of the pixels that have it."""

BRIGHTER = 8
"""By how much what is free is brighter."""


def unknown_grey(pixels: NDArray[Any], candidates: tuple[range, ...]) -> int | None:
    """Return the grey that stands for unknown, or None.

    Parameters
    ----------
    pixels : (rows, columns) or (rows, columns, channels) uint8 or uint16
        The picture; its first channel counts.
    candidates : tuple of range
        Which greys it may be, the likelier ones first.
    """
    grey = pixels if pixels.ndim == 2 else pixels[..., 0]
    eight = grey if grey.dtype == np.uint8 else (grey // 257).astype(np.uint8)
    counts = np.bincount(eight.ravel(), minlength=256)
    for greys in candidates:
        likeliest = max(greys, key=lambda level: counts[level])
        beside = int(counts[likeliest - 3 : likeliest + 4].sum() - counts[likeliest])
        is_alone = counts[likeliest] > max(ALONE * beside, LEAST_SHARE * counts.sum())
        if is_alone and counts[likeliest + BRIGHTER :].sum() > 0:
            return int(likeliest)
    return None
