"""Quantisation of point clouds: K-means, K-means++ and LBG, with relocation of codes, on CPU or GPU."""

import importlib
import time
from dataclasses import dataclass
from functools import cache, partial
from typing import Annotated, Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from lidarium.mapping.geometry.bounds import Counted, above, check_settings
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.quantisation.lloyd import (
    Codes,
    Improve,
    Nearest,
    Summary,
    at_far_points,
    drawn_codes,
    improved,
    means_of,
    nearest_codes,
    summary_of,
)
from lidarium.mapping.sparse.quantisation.tiles import Tiles, tiles_of

METHODS = ("kmeans++", "kmeans", "lbg")
"""How the first codes are found: drawn by squared distance, drawn evenly, or split from the mean on."""

MODES = ("default", "thesis")
"""Whether a code without points goes to the farthest point, or stays as in the thesis."""

DEVICES = ("cpu", "cuda", "auto")
"""Device of Lloyd's steps; ``auto`` takes a GPU if there is one."""

Budget = Annotated[float | None, above(0.0, 1e5)]
"""A time to spend, or None [s]."""


@dataclass(frozen=True, slots=True)
class QuantisationSettings:
    """How points are quantised.

    Attributes
    ----------
    method : str, default "kmeans++"
        One of METHODS.
    steps : int, default 7
        Lloyd's steps; with LBG, after each splitting. The thesis has 7.
    seed : int, default 0
        Of the draws; the same seed gives the same bits.
    mode : str, default "default"
        One of MODES.
    budget_s : float or None
        Time of the whole call that codes are moved in from where they are of least use to where the error is
        greatest [s]; such results differ with the machine. None for no such moves.
    device : str, default "cpu"
        One of DEVICES.
    """

    method: str = "kmeans++"
    steps: Counted = 7
    seed: Counted = 0
    mode: str = "default"
    budget_s: Budget = None
    device: str = "cpu"

    def __post_init__(self) -> None:
        check_settings(self, "quantisation")
        for name, allowed in (("method", METHODS), ("mode", MODES), ("device", DEVICES)):
            if getattr(self, name) not in allowed:
                raise ValueError(f"{name} of quantisation is {getattr(self, name)!r}; want one of {', '.join(allowed)}")

    @property
    def keeps_empty(self) -> bool:
        """Whether codes without points stay where they are."""
        return self.mode == "thesis"


MIN_SHIFT = 1e-3
"""Least shift of a copy along an axis [m]."""

SHIFT = 0.01
"""Shift of a copy along an axis over the standard deviation of the points."""


def _split_codes(tiles: Tiles, count: int, steps: int, improve: Improve = improved) -> Codes:
    """Return codes split in two, from the mean on, with Lloyd's steps in between.

    Returns
    -------
    (count, 3) float32
        The codes.
    """
    if count < 1 or count & (count - 1):
        raise ValueError(f"{count} codes are asked for; LBG doubles them, so want a power of two")
    mean, deviation = _mean_and_deviation(tiles)
    shift = np.maximum(SHIFT * deviation, MIN_SHIFT)
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


FIRST_SHARE = 0.2
"""Exchanges of the first round over codes."""

FEWER = 0.6
"""Exchanges of a round over those of the one before, if that was no better than the best so far."""

STEPS = 4
"""Lloyd's steps after exchanges."""


def _relocated(tiles: Tiles, codes: Codes, deadline: float, keeps_empty: bool = False) -> tuple[Codes, Nearest]:
    """Return better codes, found until a time, and the nearest of every point.

    Parameters
    ----------
    codes : (k, 3) float32
        Codes to start from [m].
    deadline : float
        When to end, on the clock of ``time.perf_counter`` [s]; a round that takes longer is not begun.

    Returns
    -------
    codes : (k, 3) float32
        Codes whose mean squared distance is not above that of those given.
    """
    began = time.perf_counter()
    best = nearest = nearest_codes(tiles, codes)
    now = time.perf_counter()
    # A round labels the points so many times, and sums them up.
    best_codes, share, longest, began = codes, FIRST_SHARE, (STEPS + 2) * (now - began), now
    while began + longest < deadline:
        maximum = int(share * len(codes))
        if maximum > 0 and len(codes) > 2:
            codes = _exchanged(codes, summary_of(tiles, codes, nearest), maximum)
        codes = improved(tiles, codes, STEPS, keeps_empty)
        nearest = nearest_codes(tiles, codes)
        if nearest.group_errors.sum() < best.group_errors.sum():
            best_codes, best = codes, nearest
        else:
            share *= FEWER
        now = time.perf_counter()
        longest, began = max(longest, now - began), now
    return best_codes, best


def _exchanged(codes: Codes, summary: Summary, maximum: int) -> Codes:
    """Return means of codes' points, some merged, and as many split in two.

    Parameters
    ----------
    codes : (k, 3) float32
        At least three codes [m].

    Returns
    -------
    (k, 3) float32
        The new codes; no code takes part in two exchanges.
    """
    means = summary.means(codes)
    costs, partners = _merging_costs(means, summary.masses)
    variances, axes = np.linalg.eigh(summary.covariances())
    gains = summary.masses * variances[:, 2]
    moved = means.copy()
    is_free = np.ones(len(codes), bool)
    cheapest, richest = iter(np.argsort(costs, kind="stable")), iter(np.argsort(-gains, kind="stable"))
    for _ in range(maximum):
        merged = next((code for code in cheapest if is_free[code] and is_free[partners[code]]), None)
        if merged is None:
            break
        other = partners[merged]
        is_free[[merged, other]] = False
        split = next((code for code in richest if is_free[code]), None)
        if split is None:
            break
        is_free[split] = False
        masses = summary.masses[[merged, other]]
        moved[other] = (masses @ means[[merged, other]]) / max(masses.sum(), np.finfo(np.float64).tiny)
        # Halves of evenly spread points have their means so far from the middle.
        shift = 0.5 * np.sqrt(3.0 * max(variances[split, 2], 0.0)) * axes[split, :, 2]
        moved[split], moved[merged] = means[split] + shift, means[split] - shift
    return moved


def _merging_costs(
    codes: Codes, masses: NDArray[np.float64], neighbours: int = 8
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the cost of merging each code with its cheapest neighbour, and that neighbour.

    Parameters
    ----------
    codes : (k, 3) float32
        The codes, at least two [m].
    masses : (k,) float64
        Weights of their points.

    Returns
    -------
    costs : (k,) float64
        Ward's distances [m2].
    partners : (k,) int
        Numbers of the neighbours.
    """
    count = min(neighbours + 1, len(codes))
    found: Any = scipy.spatial.cKDTree(codes).query(codes, count)
    distances, near = found
    own, other = masses[:, None], masses[near]
    ward = distances**2 * own * other / np.maximum(own + other, np.finfo(np.float64).tiny)
    ward[near == np.arange(len(codes))[:, None]] = np.inf
    best = ward.argmin(axis=1)
    rows = np.arange(len(codes))
    return ward[rows, best], near[rows, best]


MAX_DISTANCES = 1 << 26
"""Distances that are held at once."""


@cache
def _has_gpu() -> bool:
    """Whether torch is installed and finds a GPU."""
    try:
        torch = importlib.import_module("torch")
    except ImportError:
        return False
    return bool(torch.cuda.is_available())


def _improved_on_gpu(tiles: Tiles, codes: Codes, steps: int, keeps_empty: bool = False, device: str = "cuda") -> Codes:
    """Return codes after some of Lloyd's steps, as ``improved``, on a device of torch."""
    torch: Any = importlib.import_module("torch")
    points = torch.from_numpy(np.ascontiguousarray(tiles.points.transpose(0, 2, 1)).reshape(-1, 3)).to(device)
    masses = torch.from_numpy(tiles.weights.reshape(-1, 1)).to(device).double()
    weighted = torch.cat([points.double() * masses, masses], 1)
    for _ in range(steps):
        labels = _nearest_on(torch, points, torch.from_numpy(codes).to(device))
        sums = torch.zeros((len(codes), 4), dtype=torch.float64, device=device)
        sums.index_add_(0, labels, weighted)
        codes = means_of(tiles, codes, sums.cpu().numpy(), keeps_empty)
    return codes


def _nearest_on(torch: Any, points: Any, codes: Any) -> Any:  # noqa: ANN401
    """Return the number of the nearest code of every point."""
    numbers = torch.arange(len(codes), device=points.device)
    found = []
    for some in points.split(max(1, MAX_DISTANCES // len(codes))):
        across = [some[:, axis, None] - codes[None, :, axis] for axis in range(3)]
        x, y, z = (each * each for each in across)
        squares = x + y + z
        is_nearest = squares == squares.min(1, keepdim=True).values
        found.append(torch.where(is_nearest, numbers, len(codes)).min(1).values)
    return torch.cat(found)


@dataclass(frozen=True, slots=True, eq=False)
class Quantisation:
    """Codes of a cloud.

    Attributes
    ----------
    codes : (k, 3) float64
        The codes, of which each is a float32 [m].
    labels : (N,) int32
        The nearest code of every point, in the caller's order; of equal ones that of the lowest number.
    counts : (k,) int64
        Points of each code.
    boxes : (k, 2, 3) float32
        Least and greatest coordinates of each code's points [m]; of no points, the code itself.
    normals : (k, 3) float64
        Unit vectors along which each code's points vary least, upwards; nan if fewer than three say.
    phi1 : float
        Mean distance of points to their codes [m], the thesis's equation 5.1.
    phi2 : float
        Mean squared distance [m2], the objective that Lloyd's steps lower.
    rho : (k,) float32
        Radius of each code: greatest distance of its points [m].
    """

    codes: NDArray[np.float64]
    labels: NDArray[np.int32]
    counts: NDArray[np.int64]
    boxes: NDArray[np.float32]
    normals: NDArray[np.float64]
    phi1: float
    phi2: float
    rho: NDArray[np.float32]


def _quantisation_of(tiles: Tiles, codes: NDArray[np.float32], nearest: Nearest) -> Quantisation:
    """Return the quantisation of points by codes whose nearest are known.

    Parameters
    ----------
    codes : (k, 3) float32
        The codes [m].
    """
    summary = summary_of(tiles, codes, nearest)
    is_empty = summary.counts == 0
    boxes = np.where(is_empty[:, None, None], codes[:, None], summary.boxes)
    phi1, phi2 = summary.errors.sum(axis=0) / summary.masses.sum()
    return Quantisation(
        codes.astype(np.float64),
        _in_order(nearest.labels.reshape(-1), tiles.order),
        summary.counts,
        boxes,
        _normals(summary.covariances(), summary.counts),
        float(phi1),
        float(phi2),
        summary.radii,
    )


@kernel
def _in_order(labels: Array, order: Array) -> Array:
    """Return labels of points in the caller's order."""
    placed = np.empty(len(order), np.int32)
    for place in range(len(order)):
        placed[order[place]] = labels[place]
    return placed


def _normals(covariances: NDArray[np.float64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the directions of least variance, with z, else y, else x above zero."""
    normals: NDArray[np.float64] = np.linalg.eigh(covariances)[1][:, :, 0]
    signs = np.sign(normals)
    up = np.where(signs[:, 2] != 0, signs[:, 2], np.where(signs[:, 1] != 0, signs[:, 1], signs[:, 0]))
    normals = normals * up[:, None]
    normals[counts < 3] = np.nan
    return normals


MAX_ROUNDS = 10
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
    weights : (N,), optional
        Number of points that each represents, above 0; all 1 by default.
    start : (k, 3), optional
        Codes to start from, in place of drawn or split ones [m].
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
        codes, nearest = _relocated(tiles, codes, began + settings.budget_s, settings.keeps_empty)
    found = _quantisation_of(tiles, codes, nearest)
    for _ in range(0 if settings.keeps_empty else MAX_ROUNDS):
        if found.counts.all():
            break
        codes = at_far_points(tiles, codes, found.counts == 0)
        found = _quantisation_of(tiles, codes, nearest_codes(tiles, codes))
    return found


def _codes_of(tiles: Tiles, count: int, settings: QuantisationSettings, start: ArrayLike | None) -> Codes:
    """Return codes after Lloyd's steps from given ones or those of the method."""
    improve = _improvement(settings)
    if start is None and settings.method == "lbg":
        return _split_codes(tiles, count, settings.steps, improve)
    generator = np.random.default_rng(settings.seed)
    if start is not None:
        codes = _checked_start(start, count)
    elif settings.method == "kmeans++":
        codes, _ = drawn_codes(tiles, count, generator)
    else:
        codes = _even_draws(tiles, count, generator)
    return improve(tiles, codes, settings.steps)


def _improvement(settings: QuantisationSettings) -> Improve:
    """Return the function that takes Lloyd's steps on the device of the settings."""
    is_there = settings.device != "cpu" and _has_gpu()
    if settings.device == "cuda" and not is_there:
        raise RuntimeError("device of quantisation is 'cuda', and torch finds no GPU; want 'cpu' or 'auto'")
    return partial(_improved_on_gpu if is_there else improved, keeps_empty=settings.keeps_empty)


def _even_draws(tiles: Tiles, count: int, generator: np.random.Generator) -> Codes:
    """Return different points of the cloud, drawn by their weights alone."""
    total = len(tiles.order)
    masses = tiles.weights.reshape(-1)[:total].astype(np.float64)
    is_even = bool((masses == masses[0]).all())
    chosen = generator.choice(total, count, replace=False, p=None if is_even else masses / masses.sum())
    return np.ascontiguousarray(tiles.points[chosen // tiles.points.shape[2], :, chosen % tiles.points.shape[2]])


def _checked_points(points: ArrayLike, count: int) -> NDArray[np.float32]:
    """Return points as float32."""
    given: Any = np.asarray(points)
    if given.ndim != 2 or given.shape[1] != 3 or len(given) == 0:
        raise ValueError(f"points have shape {given.shape}; want (N, 3) with at least one point")
    if not 1 <= count <= len(given):
        raise ValueError(f"{count:,} codes are asked for of {len(given):,} points; want 1 to as many as points")
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
