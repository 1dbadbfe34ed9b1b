"""Lloyd's steps: each point to its nearest code, each code to the mean of its points.

Source: S. Lloyd, "Least squares quantization in PCM", 1982; the thesis's algorithm 2, whose mean belongs
after the loop over points. Codes are rounded to float32, so that labels are exact.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.kernels.simd.codes import TILE
from lidarium.mapping.sparse.quantisation.labelling import NO_SQUARES, label_points
from lidarium.mapping.sparse.quantisation.seeding import Nearest, come_nearer, measure, nearest_of_none
from lidarium.mapping.sparse.quantisation.tiles import Tiles

Codes = NDArray[np.float32]
Improve = Callable[[Tiles, Codes, int], Codes]
"""Takes Lloyd's steps: tiles, codes, and how many."""


def improved(tiles: Tiles, codes: Codes, steps: int, keeps_empty: bool = False) -> Codes:
    """Return codes after some of Lloyd's steps.

    Parameters
    ----------
    tiles : Tiles
        The points.
    codes : (k, 3) float32
        Codes to start from [m].
    steps : int
        How many steps.
    keeps_empty : bool
        Whether a code without points stays where it is, as in the thesis; else it goes to the point that is
        farthest from all codes.

    Returns
    -------
    (k, 3) float32
        The codes.

    Raises
    ------
    ValueError
        Where a code without points finds no point that is not at a code.
    """
    labels, sums = np.empty((len(tiles.boxes), TILE), np.int32), np.empty((len(codes), 4))
    for _ in range(steps):
        label_points(tiles, codes, labels, NO_SQUARES, sums)
        codes = means_of(tiles, codes, sums, keeps_empty)
    return codes


def means_of(tiles: Tiles, codes: Codes, sums: NDArray[np.float64], keeps_empty: bool = False) -> Codes:
    """Return the means of codes' points; codes of none stay or go to far points."""
    masses = sums[:, 3:]
    is_empty = masses[:, 0] == 0.0
    if not is_empty.any():
        return (sums[:, :3] / masses).astype(np.float32)
    means = np.where(is_empty[:, None], codes, sums[:, :3] / np.where(masses == 0.0, 1.0, masses))
    moved = means.astype(np.float32)
    return moved if keeps_empty else at_far_points(tiles, moved, is_empty)


def at_far_points(tiles: Tiles, codes: Codes, is_empty: NDArray[np.bool_]) -> Codes:
    """Move some codes, one by one, to the point that is farthest from all others."""
    nearest, moved = nearest_codes(tiles, codes[~is_empty]), codes.copy()
    for number in np.flatnonzero(is_empty):
        farthest = _farthest_point(tiles, nearest)
        if len(farthest) == 0:
            raise ValueError(
                f"points are at fewer than {len(codes):,} different places; want at least one for each code"
            )
        moved[number] = farthest
        come_nearer(tiles, farthest, number, nearest)
    return moved


def nearest_codes(tiles: Tiles, codes: Codes) -> Nearest:
    """Return the nearest code of every point, with the distance to it."""
    nearest = nearest_of_none(tiles)
    label_points(tiles, codes, nearest.labels, nearest.squares, np.empty((len(codes), 4)))
    measure(tiles, nearest)
    return nearest


@kernel
def _farthest_point(tiles: Tiles, nearest: Nearest) -> Array:
    """Return the point farthest from its code, (3,); (0,) where all are at codes."""
    tile = int(np.argmax(nearest.worst))
    if nearest.worst[tile] == np.float32(0.0):
        return np.empty(0, np.float32)
    return tiles.points[tile, :, np.argmax(nearest.squares[tile])].copy()
