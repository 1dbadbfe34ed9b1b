"""Quantisation of a cloud: checks, first codes, Lloyd's steps, exchanges in the time that is left."""

import time
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.sparse.quantisation.lloyd import Codes, Improve, at_far_points, improved, nearest_codes
from lidarium.mapping.sparse.quantisation.on_gpu import has_gpu, improved_on_gpu
from lidarium.mapping.sparse.quantisation.quantisation import Quantisation, quantisation_of
from lidarium.mapping.sparse.quantisation.relocation import relocated
from lidarium.mapping.sparse.quantisation.seeding import drawn_codes
from lidarium.mapping.sparse.quantisation.settings import QuantisationSettings
from lidarium.mapping.sparse.quantisation.splitting import split_codes
from lidarium.mapping.sparse.quantisation.tiles import Tiles, tiles_of

MOST_ROUNDS = 10
"""Most rounds in which codes that lost their points at the end are moved once more."""

_USUAL = QuantisationSettings()


def quantise(
    points: ArrayLike,
    count: int,
    settings: QuantisationSettings = _USUAL,
    weights: ArrayLike | None = None,
    start: ArrayLike | None = None,
) -> Quantisation:
    """Quantise points: find codes of which one is near to every point.

    Parameters
    ----------
    points : (N, 3)
        The points, rounded to float32 [m].
    count : int
        How many codes, k.
    settings : QuantisationSettings
        How.
    weights : (N,), optional
        How many points each stands for, above 0; all 1 by default.
    start : (k, 3), optional
        Codes to start from, in place of drawn or split ones [m].

    Returns
    -------
    Quantisation
        Codes, labels and what is known of each code.

    Raises
    ------
    ValueError
        Where there are no points, fewer different ones than codes, or such as are not finite; where all are
        equal; where weights or start do not fit; where LBG is asked for a number that is no power of two.
    RuntimeError
        Where a GPU is asked for and there is none.
    """
    began = time.perf_counter()
    places = _checked_points(points, count)
    masses = None if weights is None else _checked_weights(weights, len(places))
    tiles = tiles_of(places, masses)
    low, high = tiles.group_boxes[:, 0].min(axis=0), tiles.group_boxes[:, 1].max(axis=0)
    if len(places) > 1 and (low == high).all():
        raise ValueError(f"all {len(places):,} points are at {low.tolist()}; want different ones")
    codes = _codes_of(tiles, count, settings, start)
    nearest = nearest_codes(tiles, codes)
    if settings.budget_s is not None:
        codes, nearest = relocated(tiles, codes, began + settings.budget_s, settings.keeps_empty)
    found = quantisation_of(tiles, codes, nearest)
    for _ in range(0 if settings.keeps_empty else MOST_ROUNDS):
        if found.counts.all():
            break
        codes = at_far_points(tiles, codes, found.counts == 0)
        found = quantisation_of(tiles, codes, nearest_codes(tiles, codes))
    return found


def _codes_of(tiles: Tiles, count: int, settings: QuantisationSettings, start: ArrayLike | None) -> Codes:
    """Return codes after Lloyd's steps from given ones or those of the method."""
    improve = _improvement(settings)
    if start is None and settings.method == "lbg":
        return split_codes(tiles, count, settings.steps, improve)
    generator = np.random.default_rng(settings.seed)
    if start is not None:
        codes = _checked_start(start, count)
    elif settings.method == "kmeans++":
        codes, _ = drawn_codes(tiles, count, generator)
    else:
        codes = _even_draws(tiles, count, generator)
    return improve(tiles, codes, settings.steps)


def _improvement(settings: QuantisationSettings) -> Improve:
    """Return what takes Lloyd's steps on the device of the settings."""
    is_there = settings.device != "cpu" and has_gpu()
    if settings.device == "cuda" and not is_there:
        raise RuntimeError("device of quantisation is 'cuda', and torch finds no GPU; want 'cpu' or 'auto'")
    return partial(improved_on_gpu if is_there else improved, keeps_empty=settings.keeps_empty)


def _even_draws(tiles: Tiles, count: int, generator: np.random.Generator) -> Codes:
    """Return different points of the cloud, drawn by their weights alone."""
    total = len(tiles.order)
    masses = tiles.weights.reshape(-1)[:total].astype(np.float64)
    is_even = bool((masses == masses[0]).all())
    chosen = generator.choice(total, count, replace=False, p=None if is_even else masses / masses.sum())
    return np.ascontiguousarray(
        tiles.points[chosen // tiles.points.shape[2], :, chosen % tiles.points.shape[2]]
    )


def _checked_points(points: ArrayLike, count: int) -> NDArray[np.float32]:
    """Return points as float32."""
    given: Any = np.asarray(points)
    if given.ndim != 2 or given.shape[1] != 3 or len(given) == 0:
        raise ValueError(f"points have shape {given.shape}; want (N, 3) with at least one point")
    if not 1 <= count <= len(given):
        raise ValueError(
            f"{count:,} codes are asked for of {len(given):,} points; want 1 to as many as points"
        )
    return np.ascontiguousarray(given, np.float32)


def _checked_weights(weights: ArrayLike, count: int) -> NDArray[np.float32]:
    """Return weights as float32."""
    masses = np.ascontiguousarray(weights, np.float32)
    if masses.shape != (count,):
        raise ValueError(f"weights have shape {masses.shape}; want ({count:,},), one for each point")
    if not (np.isfinite(masses).all() and (masses > 0.0).all()):
        raise ValueError("weights are not all finite and above 0; leave out points that are not to count")
    return masses


def _checked_start(start: ArrayLike, count: int) -> Codes:
    """Return first codes as float32."""
    codes = np.ascontiguousarray(start, np.float32)
    if codes.shape != (count, 3) or not np.isfinite(codes).all():
        raise ValueError(f"start has shape {codes.shape}; want ({count:,}, 3), finite [m]")
    return codes
