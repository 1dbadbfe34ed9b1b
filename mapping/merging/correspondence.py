"""Which corners of one map may be which of another: four methods behind one call.

Descriptors are compared under all rotations at once: a correlation along the angle is a product of spectra.

Corners are alike by their descriptors, or by the corners around them: distances, triangles and clusters. A
rigid motion keeps the latter, so they need no descriptors.

References
----------
Methods a and b of the thesis on merging; clusters by radius replace its equations 3-10 and 3-11, of which only
the idea is known: a corner's cluster are the corners within a radius, and two clusters are one if their
distances are.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Count, Length, check_settings, share, within
from lidarium.mapping.geometry.rigid import wrapped
from lidarium.mapping.merging.corners import Corners
from lidarium.mapping.merging.descriptors import Descriptors

MIN_CLUSTER = 2
"""Corners beside its own that a cluster needs."""


def _common_distances(first: NDArray[np.float64], second: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return the share of common distances of each pair of corners, (n, m).

    The share of the first corner's distances that the second one has too.
    """
    votes = _common(_distances(first), _distances(second), tolerance)
    return np.asarray(votes / max(len(first) - 1, 1))


def _like_clusters(
    first: NDArray[np.float64], second: NDArray[np.float64], tolerance: float, radius_m: float
) -> NDArray[np.float64]:
    """Return the share of common distances of each pair of corners within a radius, (n, m).

    The share is that of the larger cluster; 0 if either has fewer than ``MIN_CLUSTER`` corners beside
    its own.
    """
    left, right = (_within(_distances(points), radius_m) for points in (first, second))
    common = np.minimum(_common(left, right, tolerance), _common(right, left, tolerance).T)
    sizes = [np.count_nonzero(distances > 0.0, axis=1) for distances in (left, right)]
    larger = np.maximum(sizes[0][:, None], sizes[1][None])
    smaller = np.minimum(sizes[0][:, None], sizes[1][None])
    return np.where(smaller >= MIN_CLUSTER, common / np.maximum(larger, 1), 0.0)


def _like_triangles(first: NDArray[np.float64], second: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return the similarity of the triangles of each pair of corners, (n, m).

    Triangles are with the two nearest neighbours; 0 if they are not alike.
    """
    if len(first) < 3 or len(second) < 3:
        return np.zeros((len(first), len(second)))
    left, right = _triangles(first), _triangles(second)
    longer = np.maximum(left[:, None], right[None])
    difference = (np.abs(left[:, None] - right[None]) / np.maximum(longer, 1e-9)).max(axis=2)
    return np.where(difference <= tolerance, 1.0 - difference, 0.0)


def _common(left: NDArray[np.float64], right: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Count the distances of each row (n, n) that each row of others (m, m) has too, (n, m); 0 is none."""
    votes = np.zeros((len(left), len(right)))
    for j, row in enumerate(right):
        lengths = np.sort(row[row > 0.0])
        if len(lengths) == 0:
            continue
        # A length has a like one if the first not shorter than its lower bound is not longer than its upper
        # bound.
        position = np.minimum(np.searchsorted(lengths, left * (1.0 - tolerance)), len(lengths) - 1)
        votes[:, j] = (
            (lengths[position] >= left * (1.0 - tolerance))
            & (lengths[position] * (1.0 - tolerance) <= left)
            & (left > 0.0)
        ).sum(axis=1)
    return votes


def _within(distances: NDArray[np.float64], radius_m: float) -> NDArray[np.float64]:
    return np.where(distances <= radius_m, distances, 0.0)


def _triangles(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sides of each corner's triangle of neighbours, (n, 3) [m].

    Distances to the nearest and second neighbour, and between the two.
    """
    distances = _distances(points)
    order = np.argsort(distances + np.diag(np.full(len(points), np.inf)), axis=1, kind="stable")[:, :2]
    rows = np.arange(len(points))
    return np.stack(
        [distances[rows, order[:, 0]], distances[rows, order[:, 1]], distances[order[:, 0], order[:, 1]]],
        axis=1,
    )


def _distances(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.linalg.norm(points[:, None] - points[None], axis=2))


METHODS = ("descriptors", "distances", "triplets", "radius")
MEASURES = ("correlation", "difference")


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrespondenceSettings:
    """How corners are matched.

    Attributes
    ----------
    method : str
        ``descriptors``, ``distances`` (pairs of corners equally far apart in both maps), ``triplets``
        (corners whose two nearest neighbours form the same triangle) or ``radius`` (corners whose neighbours
        within ``cluster_radius_m`` are equally far away).
    measure : str, default "correlation"
        How descriptors are compared: ``correlation``, normalised; ``difference``, 1 less half the mean square
        of the difference of their samples over their mean square.
    excludes_opposite : bool, default False
        Whether a match is left out whose corners are as similar turned by 180 degrees: along a straight wall
        either is as good.
    threshold : float, default 0.55
        Similarity of two descriptors from which they match, 1 for equal ones.
    margin : float, default 0.1
        A match is at most so much less similar than the best of its corner.
    per_corner : int, default 5
        Maximum number of matches for a corner of the first map.
    shift_window : float
        How far the rotation may differ from the difference of the corners' angles [rad].
    is_known_only : bool, default True
        Whether the similarity is taken over what is known in both descriptors, about zero; otherwise over all
        samples, about their mean.
    least_known : float, default 0.25
        Share of samples known in both from which descriptors are compared at all, with ``is_known_only``.
    use_shift : bool, default True
        Whether the best shift refines a match's rotation; otherwise it is the difference of the corners'
        angles.
    length_tolerance : float, default 0.08
        Two lengths are equal if they differ by at most this share of the longer one.
    cluster_radius_m : float, default 3.0
        Reach of the cluster of corners around a corner, with ``radius`` [m].
    """

    method: str = "descriptors"
    measure: str = "correlation"
    excludes_opposite: bool = False
    threshold: Annotated[float, within(-1.0, 1.0)] = 0.55
    margin: Annotated[float, within(0.0, 2.0)] = 0.10
    per_corner: Count = 5
    shift_window: Annotated[float, within(0.0, math.pi)] = math.radians(24.0)
    is_known_only: bool = True
    least_known: Annotated[float, share()] = 0.25
    use_shift: bool = True
    length_tolerance: Annotated[float, share(has_minimum=False, has_maximum=False)] = 0.08
    cluster_radius_m: Length = 3.0

    def __post_init__(self) -> None:
        check_settings(self, "correspondence")
        if self.method not in METHODS:
            raise ValueError(f"method of correspondence is {self.method!r}; want one of {', '.join(METHODS)}")
        if self.measure not in MEASURES:
            raise ValueError(f"measure of correspondence is {self.measure!r}; want one of {', '.join(MEASURES)}")


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Pairs of corners that may be one.

    Attributes
    ----------
    first, second : (n,) int64
        Corners of map a and of map b.
    similarity : (n,) float64
        1 for equal surroundings.
    rotation : (n,) float64
        Angle of map b's axes in map a that the pair proposes [rad], in (-pi, pi].
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    similarity: NDArray[np.float64]
    rotation: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.first)


NO_MATCHES = Matches(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
"""Of maps whose corners are not matched."""


def match_corners(
    first: Corners,
    second: Corners,
    first_descriptors: Descriptors,
    second_descriptors: Descriptors,
    settings: CorrespondenceSettings,
) -> Matches:
    """Match the corners of map a with those of map b."""
    if len(first) == 0 or len(second) == 0:
        return Matches(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
    difference = first.angles[:, None] - second.angles[None, :]
    similarity: NDArray[np.floating]
    shift: NDArray[np.floating]
    if settings.method == "descriptors":
        similarity, shift = _compare_descriptors(first_descriptors, second_descriptors, settings)
    else:
        similarity, shift = _compared_places(first.points, second.points, settings), np.zeros_like(difference)
    # Of a corner seen at a in the first map and at b in the second, the second map is turned by a - b.
    rotation = difference + shift if settings.use_shift else difference
    threshold = settings.threshold if settings.method == "descriptors" else 0.0
    i, j = _chosen(similarity, threshold, settings)
    return Matches(
        i,
        j,
        similarity[i, j].astype(np.float64),
        np.array([wrapped(angle) for angle in rotation[i, j].tolist()]),
    )


def _compare_descriptors(
    first: Descriptors, second: Descriptors, settings: CorrespondenceSettings
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Compare each descriptor of a map with each of another.

    Under all shifts of the angle.

    Returns
    -------
    similarity : (n, m) float32
        The largest normalised correlation within the window of shifts, -1 if too little is known in both.
    shift : (n, m) float32
        Angle of it [rad]: the first corner sees at an angle what the second sees at that angle less the
        shift.
    """
    columns = first.values.shape[2]
    if settings.is_known_only:
        # Where a sample is half known, so is its square; sums over what is known in both are three
        # correlations.
        product = _correlation(first.values, second.values)
        first_energy = _correlation(first.values**2, second.known)
        second_energy = _correlation(first.known, second.values**2)
        known = _correlation(first.known, second.known)
        is_comparable = known >= settings.least_known * first.values.shape[1] * columns
        energy = _energy(first_energy, second_energy, settings.measure)
        similarity = np.where(is_comparable, product / np.maximum(energy, 1e-6), -1.0)
    elif settings.measure == "correlation":
        similarity = _correlation(_standardised(first.values), _standardised(second.values))
    else:
        energies = ((one.values**2).sum(axis=(1, 2)) for one in (first, second))
        left, right = next(energies)[:, None, None], next(energies)[None, :, None]
        product = _correlation(first.values, second.values)
        similarity = product / np.maximum(_energy(left, right, settings.measure), 1e-6)
    reach = min(int(settings.shift_window / (2.0 * math.pi / columns) + 1e-9), columns // 2 - 1)
    shifts = np.arange(-reach, reach + 1)
    window = similarity[:, :, shifts % columns]
    best = window.argmax(axis=2)
    peak = np.take_along_axis(window, best[:, :, None], axis=2)[:, :, 0]
    angle = shifts[best] * (2.0 * math.pi / columns)
    if settings.excludes_opposite:
        turned = (shifts[best] + columns // 2) % columns
        opposite = np.take_along_axis(similarity, turned[:, :, None], axis=2)[:, :, 0]
        peak = np.where(opposite >= peak - settings.margin, np.float32(-1.0), peak)
    return np.asarray(peak, np.float32), np.asarray(angle, np.float32)


def _compared_places(
    first: NDArray[np.float64], second: NDArray[np.float64], settings: CorrespondenceSettings
) -> NDArray[np.float64]:
    """Return the similarity of corners (n, m) by the positions of their neighbours."""
    tolerance = settings.length_tolerance
    if settings.method == "distances":
        return _common_distances(first, second, tolerance)
    if settings.method == "triplets":
        return _like_triangles(first, second, tolerance)
    return _like_clusters(first, second, tolerance, settings.cluster_radius_m)


def _energy(first: NDArray[np.floating], second: NDArray[np.floating], measure: str) -> NDArray[np.floating]:
    """Return the divisor of products of samples: their geometric mean square, or their mean square.

    The product over the mean square is 1 less half the square of the difference over it.
    """
    if measure == "correlation":
        return np.asarray(np.sqrt(np.maximum(first * second, 1e-12)))
    return np.asarray(0.5 * (first + second))


def _standardised(values: NDArray[np.float32]) -> NDArray[np.float32]:
    centred = values - values.mean(axis=(1, 2), keepdims=True)
    return np.asarray(centred / np.maximum(np.sqrt((centred**2).sum(axis=(1, 2), keepdims=True)), 1e-9), np.float32)


def _correlation(first: NDArray[np.float32], second: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the correlation of all pairs at all shifts, shape (n, m, columns).

    The sum over rings and columns of first[column + shift] ... second[column].
    """
    columns = first.shape[2]
    # One product of matrices for each frequency: (n, rings) by (rings, m).
    left = np.ascontiguousarray(scipy.fft.rfft(first, axis=2).transpose(2, 0, 1))
    right = np.ascontiguousarray(scipy.fft.rfft(second, axis=2).conj().transpose(2, 1, 0))
    spectrum = np.matmul(left, right).transpose(1, 2, 0)
    return np.asarray(scipy.fft.irfft(spectrum, n=columns, axis=2), np.float32)


def _chosen(
    similarity: NDArray[np.floating], threshold: float, settings: CorrespondenceSettings
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pairs that are similar enough.

    They are near the best pair of their corner, and among its first few.
    """
    best = similarity.max(axis=1, keepdims=True)
    count = min(settings.per_corner, similarity.shape[1])
    order = np.argsort(-similarity, axis=1, kind="stable")[:, :count]
    values = np.take_along_axis(similarity, order, axis=1)
    is_match = (values > 0.0) & (values >= threshold) & (values >= best - settings.margin)
    i, rank = np.nonzero(is_match)
    return i.astype(np.int64), order[i, rank].astype(np.int64)
