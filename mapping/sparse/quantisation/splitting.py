"""Codes that split in two: LBG.

Source: Y. Linde, A. Buzo, R. Gray, "An algorithm for vector quantizer design", 1980; the thesis's
algorithm 3, in whose print the second copy is made of the moved first one. Nothing is drawn: the same points
give the same codes.
"""

import numpy as np

from lidarium.mapping.sparse.quantisation.lloyd import Codes, Improve, improved
from lidarium.mapping.sparse.quantisation.tiles import Tiles

LEAST_SHIFT = 1e-3
"""Least shift of a copy along an axis [m]."""

SHIFT = 0.01
"""Shift of a copy along an axis over the standard deviation of the points."""


def split_codes(tiles: Tiles, count: int, steps: int, improve: Improve = improved) -> Codes:
    """Return codes split in two, from the mean on, with Lloyd's steps in between.

    Parameters
    ----------
    tiles : Tiles
        The points.
    count : int
        How many codes, a power of two.
    steps : int
        Lloyd's steps after each splitting.
    improve : callable
        Takes Lloyd's steps, as ``improved``.

    Returns
    -------
    (count, 3) float32
        The codes.

    Raises
    ------
    ValueError
        Where ``count`` is no power of two, or points are at fewer different places.
    """
    if count < 1 or count & (count - 1):
        raise ValueError(f"{count} codes are asked for; LBG doubles them, so want a power of two")
    mean, deviation = _mean_and_deviation(tiles)
    shift = np.maximum(SHIFT * deviation, LEAST_SHIFT)
    codes = mean[None].astype(np.float32)
    while len(codes) < count:
        codes = np.concatenate([codes + shift, codes - shift]).astype(np.float32)
        codes = improve(tiles, codes, steps)
    return codes


def _mean_and_deviation(tiles: Tiles) -> tuple[np.ndarray, np.ndarray]:
    """Return the weighted mean and standard deviation of points along each axis [m]."""
    sums = tiles.sums.sum(axis=0)
    mean = sums[:3] / sums[3]
    squares = np.einsum("tl,tal->a", tiles.weights, np.square(tiles.points - mean[:, None]), optimize=False)
    return mean, np.sqrt(squares / sums[3])
