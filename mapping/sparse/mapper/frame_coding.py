"""Codes of one cloud: preprocessing, separation of floor and obstacles, quantisation, cutting.

References
----------
Sparse mapper, section 2.

Sparse mapper, section 4, step 3. The thesis splits codes; points are split here before they are coded, so
that no code has both.

Sparse mapper, section 3.3: seeds drawn by squared distance, then Lloyd's steps.

I. Wald, "On fast construction of SAH-based bounding volume hierarchies", Symposium on Interactive Ray Tracing
2007: planes between bins of points.

Sparse mapper, section 4.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.point_clouds.point_cloud import numbered
from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.graph import reduced_nodes
from lidarium.mapping.sparse.mapper.merging import boxes_of, masses_of, means_of, normals_of
from lidarium.mapping.sparse.quantisation.quantiser import QuantisationSettings, quantise
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import FreeCodes, OccupiedCodes, free_codes, occupied_codes

WIDEST_M = 2000.0
"""Widest cloud [m]; millimetres are wider."""

_CELL_BITS = 21


class _Voxels(NamedTuple):
    """Points gathered in voxels.

    Attributes
    ----------
    means : (V, 3) float64
        Mean of each voxel's points [m].
    weights : (V,) float64
        Number of these are.
    labels : (N,) int64
        Voxel of each point.
    """

    means: NDArray[np.float64]
    weights: NDArray[np.float64]
    labels: NDArray[np.int64]


def usable_points(points: NDArray[np.floating], range_m: float | None = None) -> NDArray[np.float64]:
    """Return the finite points of a cloud that are near enough.

    Parameters
    ----------
    points : (N, 3) float
        The cloud, seen from its origin [m].
    range_m : float or None
        Farthest point that is kept [m]; None for any.

    Returns
    -------
    (M, 3) float64
        Points, in their order [m].
    """
    cloud = np.array(points, np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise ValueError(f"points have shape {cloud.shape}; want (N, 3)")
    if len(cloud) == 0:
        raise ValueError("the cloud has no points; want some")
    is_finite = np.isfinite(cloud)
    finite = cloud if is_finite.all() else cloud[is_finite.all(axis=1)]
    if len(finite) == 0:
        raise ValueError(f"none of the {len(cloud):,} points of the cloud is finite; want numbers")
    if range_m is not None:
        squares = np.einsum("ij,ij->i", finite, finite)
        near = finite[squares <= range_m * range_m]
        if len(near) == 0:
            raise ValueError(
                f"the nearest point of the cloud is {np.sqrt(squares.min()):.4g} m away; want points in "
                f"metres within {range_m:g} m, or a longer range"
            )
        return np.asarray(near)
    low, high = np.percentile(finite, (1.0, 99.0), axis=0)
    if float((high - low).max()) > WIDEST_M:
        raise ValueError(
            f"the cloud is {(high - low).max():,.0f} m wide; want at most {WIDEST_M:,.0f} m: are these millimetres?"
        )
    return finite


def voxels_of(points: NDArray[np.float64], side: float) -> _Voxels:
    """Gather points in voxels.

    Parameters
    ----------
    points : (N, 3) float64
        Points [m].
    side : float
        Side of a voxel [m]; 0 for one voxel a point.
    """
    if side <= 0.0 or len(points) == 0:
        return _Voxels(points, np.ones(len(points)), np.arange(len(points)))
    labels, count = numbered(_voxel_keys(points, points.min(axis=0), side))
    means, weights = _voxel_means(points, labels, count)
    return _Voxels(means, weights, labels)


@kernel
def _voxel_keys(points: Array, low: Array, side: float) -> NDArray[np.int64]:
    """Return the number of each point's voxel, counted from the lowest corner."""
    keys = np.zeros(len(points), np.int64)
    for k in range(len(points)):
        for axis in (2, 1, 0):
            cell = min(math.floor((points[k, axis] - low[axis]) / side), (1 << _CELL_BITS) - 1)
            keys[k] = (keys[k] << _CELL_BITS) | cell
    return keys


@kernel
def _voxel_means(points: Array, labels: Array, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean of each voxel's points, and their number."""
    means, weights = np.zeros((count, 3)), np.zeros(count)
    for k in range(len(points)):
        weights[labels[k]] += 1.0
        for axis in range(3):
            means[labels[k], axis] += points[k, axis]
    for voxel in range(count):
        for axis in range(3):
            means[voxel, axis] /= weights[voxel]
    return means, weights


_NEIGHBOURS = 16


def _is_floor(points: NDArray[np.float64], floor: FloorPlane, settings: MapperSettings) -> NDArray[np.bool_]:
    """Return which points (N, 3) [m] are floor, (N,) bool."""
    if settings.split == "height":
        return np.asarray(floor.heights(points) <= settings.floor_height_m)
    is_level = np.abs(_surface_normals(points) @ floor.normal) >= math.cos(settings.most_slope)
    if settings.split == "normal":
        return np.asarray(is_level & ~_hangs_over(points, floor, settings))
    return np.asarray(is_level & (floor.heights(points) <= settings.floor_height_m))


def _hangs_over(points: NDArray[np.float64], floor: FloorPlane, settings: MapperSettings) -> NDArray[np.bool_]:
    """Return which points are too high to be driven up to: table tops, seats."""
    reach = floor.heights(points) - settings.floor_height_m
    aside = points @ floor.levelling()[:2, :3].T
    low = aside[reach <= 0.0]
    if len(low) == 0:
        return np.ones(len(points), np.bool_)
    # A ramp rises from the floor no steeper than its slope allows.
    gaps = scipy.spatial.cKDTree(low).query(aside)[0]
    return np.asarray(reach > gaps * math.tan(settings.most_slope))


def _surface_normals(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit normals around points (N, 3), either way round, (N, 3)."""
    count = min(_NEIGHBOURS, len(points))
    if count < 3:
        return np.zeros(points.shape)
    near = points[np.reshape(scipy.spatial.cKDTree(points).query(points, count)[1], (len(points), count))]
    near = near - near.mean(axis=1, keepdims=True)
    return np.asarray(np.linalg.eigh(np.einsum("nki,nkj->nij", near, near))[1][:, :, 0])


def _coded(
    points: NDArray[np.float64], weights: NDArray[np.float64], count: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return codes of weighted points.

    Parameters
    ----------
    points : (N, 3) float64
        Points [m], at least one.
    weights : (N,) float64
        Their weights, above zero.

    Returns
    -------
    (k, 3) float64
        Codes [m], each with a point.
    (N,) int64
        The code of each point.
    """
    found = quantise(points, min(count, len(points)), QuantisationSettings(seed=seed), weights)
    held, labels = np.unique(found.labels, return_inverse=True)
    return found.codes[held], labels


BINS = 16
"""Slices of a box; it is cut between two of them."""

MIN_GAIN = 0.25
"""Share of a box that both of its parts have to leave out."""

MIN_POINTS = 3
"""Points that each part has to have."""

MIN_SIDE_M = 0.05
"""A box with no longer side is left whole [m]."""


def cut_labels(
    points: NDArray[np.float64], labels: NDArray[np.int64], pad: float, maximum: int | None = None
) -> NDArray[np.int64]:
    """Return the labels of points after codes with much empty room were cut.

    Parameters
    ----------
    points : (N, 3) float64
        Points [m].
    labels : (N,) int64
        Code of each point, from 0; each code has one.
    pad : float
        By how much boxes are taken to be larger along each axis, as flat ones have no room [m].

    Returns
    -------
    (N,) int64
        Labels from 0; points of different codes still have different ones.
    """
    if maximum == 0:
        return labels
    order = np.argsort(labels, kind="stable")
    starts = np.append(np.flatnonzero(np.diff(labels[order], prepend=-1)), len(labels))
    ranked, found = points[order], np.empty(len(labels), np.int64)
    parts, gains = _cut(ranked, starts, pad, 0.0)
    if maximum is not None and len(gains) > maximum:
        # A part of what gains less than these is not reached: there may be fewer cuts, never more.
        parts, _ = _cut(ranked, starts, pad, float(np.nextafter(np.sort(gains)[-maximum - 1], np.inf)))
    found[order] = parts
    return np.unique(found, return_inverse=True)[1]


@kernel
def _cut(points: Array, starts: Array, pad: float, minimum: float) -> tuple[Array, Array]:
    """Cut points (N, 3) that are sorted by their codes; return the part of each, and the gain of each cut."""
    count = points.shape[0]
    order, other = np.arange(count), np.empty(count, np.int64)
    bounds, parts = np.empty((BINS + 2, 6)), np.empty(count, np.int64)
    firsts, lasts = np.empty(count, np.int64), np.empty(count, np.int64)
    gains, cuts = np.empty(count), 0
    for code in range(starts.shape[0] - 1):
        firsts[0], lasts[0], waiting = starts[code], starts[code + 1], 1
        while waiting > 0:
            waiting -= 1
            first, last = firsts[waiting], lasts[waiting]
            axis, plane, gain = _best_plane(points, order[first:last], pad, bounds)
            middle = first
            if axis >= 0 and gain >= minimum:
                middle = _part(points[:, axis], order, first, last, plane, other)
            if middle - first < MIN_POINTS or last - middle < MIN_POINTS:
                for place in range(first, last):
                    parts[order[place]] = first
                continue
            gains[cuts] = gain
            cuts += 1
            firsts[waiting], lasts[waiting] = first, middle
            firsts[waiting + 1], lasts[waiting + 1] = middle, last
            waiting += 2
    return parts, gains[:cuts]


@kernel(nrt=False)
def _best_plane(points: Array, members: Array, pad: float, bounds: Array) -> tuple[int, float, float]:
    """Return axis and place of the plane that leaves least room, and the gain; -1 if that is too small."""
    whole, around = bounds[BINS], bounds[BINS + 1]
    _begin(whole)
    for member in members:
        _widen(whole, points[member], points[member])
    best_axis, best_plane, minimum = -1, 0.0, (1.0 - MIN_GAIN) * _room(whole, pad)
    for axis in range(3):
        side = whole[axis + 3] - whole[axis]
        if side < MIN_SIDE_M:
            continue
        for slot in range(BINS):
            _begin(bounds[slot])
        for member in members:
            slot = min(int((points[member, axis] - whole[axis]) / side * BINS), BINS - 1)
            _widen(bounds[slot], points[member], points[member])
        for plane in range(1, BINS):
            room = _room_of(bounds[:plane], pad, around) + _room_of(bounds[plane:BINS], pad, around)
            if room < minimum:
                best_axis, best_plane, minimum = axis, whole[axis] + side * plane / BINS, room
    return best_axis, best_plane, _room(whole, pad) - minimum


@kernel(nrt=False)
def _room_of(bounds: Array, pad: float, around: Array) -> Any:  # noqa: ANN401
    """Return the volume of the box around boxes (B, 6) [m3]; that box is written as well."""
    _begin(around)
    for slot in range(bounds.shape[0]):
        if bounds[slot, 0] <= bounds[slot, 3]:
            _widen(around, bounds[slot, :3], bounds[slot, 3:])
    return _room(around, pad)


@kernel(nrt=False)
def _begin(box: Array) -> None:
    """Make a box that holds nothing."""
    for axis in range(3):
        box[axis], box[axis + 3] = np.inf, -np.inf


@kernel(nrt=False)
def _widen(box: Array, low: Array, high: Array) -> None:
    for axis in range(3):
        box[axis] = min(box[axis], low[axis])
        box[axis + 3] = max(box[axis + 3], high[axis])


@kernel(nrt=False)
def _room(box: Array, pad: float) -> Any:  # noqa: ANN401
    if box[0] > box[3]:
        return 0.0
    return (box[3] - box[0] + pad) * (box[4] - box[1] + pad) * (box[5] - box[2] + pad)


@kernel(nrt=False)
def _part(values: Array, order: Array, first: int, last: int, plane: float, other: Array) -> int:
    """Sort those below a plane before the others, each in their order; return where the others begin."""
    low, high = first, 0
    for place in range(first, last):
        member = order[place]
        if values[member] < plane:
            order[low] = member
            low += 1
        else:
            other[high] = member
            high += 1
    for k in range(high):
        order[low + k] = other[k]
    return low


def code_counts(count: int, floor_share: float) -> tuple[int, int]:
    """Return how many codes obstacles and floor get, of ``count``, at least one each."""
    if not count >= 2:
        raise ValueError(f"k is {count}; want at least 2 codes, of floor and obstacles")
    on_floor = min(max(round(count * floor_share), 1), count - 1)
    return count - on_floor, on_floor


def _between_cuts(points: NDArray[np.float64], floor: FloorPlane, settings: MapperSettings) -> NDArray[np.bool_]:
    """Return which points (N, 3) are neither too deep nor too high, (N,) bool."""
    heights = floor.heights(points)
    return np.asarray((heights >= -settings.noise_depth_m) & (heights <= settings.ceiling_m))


def split_points(
    points: NDArray[np.float64], floor: FloorPlane, settings: MapperSettings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the points of obstacles and those of the floor, without points out of range."""
    points = points[_between_cuts(points, floor, settings)]
    if settings.split == "height":
        on_floor = _is_floor(points, floor, settings)
    else:
        voxels = voxels_of(points, settings.voxel_m)
        on_floor = _is_floor(voxels.means, floor, settings)[voxels.labels]
    return points[~on_floor], points[on_floor]


def coded_obstacles(points: NDArray[np.float64], count: int, settings: MapperSettings, frame: int = 0) -> OccupiedCodes:
    """Return the codes of obstacles, each with the box of its points.

    Parameters
    ----------
    points : (N, 3) float64
        Points in the map [m].
    """
    if len(points) == 0 or count < 1:
        return occupied_codes(np.empty((0, 2, 3)), frame)
    voxels, labels = labelled_voxels(points, count, settings, frame)
    if settings.merges:
        labels = cut_labels(voxels.means, labels, settings.voxel_m)
    return codes_of_labels(points, voxels, labels, frame)


def labelled_voxels(
    points: NDArray[np.float64], count: int, settings: MapperSettings, frame: int
) -> tuple[_Voxels, NDArray[np.int64]]:
    """Return the voxels of points (N, 3) and the code of each, of at most ``count`` codes."""
    voxels = voxels_of(points, settings.voxel_m)
    return voxels, _coded(voxels.means, voxels.weights, count, settings.seed + frame)[1]


def codes_of_labels(
    points: NDArray[np.float64], voxels: _Voxels, labels: NDArray[np.int64], frame: int
) -> OccupiedCodes:
    """Return the codes of points (N, 3) whose voxels have labels (V,) from 0."""
    number = int(labels.max()) + 1
    return OccupiedCodes(
        boxes=boxes_of(points, labels[voxels.labels], number),
        centres=means_of(voxels.means, voxels.weights, labels, number),
        weights=masses_of(labels, voxels.weights, number),
        normals=normals_of(voxels.means, voxels.weights, labels, number),
        frames=np.full(number, frame, np.int64),
    )


def coded_floor(points: NDArray[np.float64], count: int, settings: MapperSettings, frame: int = 0) -> FreeCodes:
    """Return at most a number of codes of floor points (N, 3) [m], close ones merged."""
    if len(points) == 0 or count < 1:
        return free_codes(np.empty((0, 3)), frame)
    voxels = voxels_of(points, settings.voxel_m)
    centres, _ = _coded(voxels.means, voxels.weights, count, settings.seed + frame)
    return free_codes(reduced_nodes(centres, settings.merge_radius_m), frame)


def coded_as_points(
    points: NDArray[np.float64], count: int, floor: FloorPlane, settings: MapperSettings, frame: int = 0
) -> tuple[OccupiedCodes, FreeCodes]:
    """Return codes as the thesis has them: points, split by their own height.

    Parameters
    ----------
    points : (N, 3) float64
        Points in the map [m].
    """
    voxels = voxels_of(points, settings.voxel_m)
    centres, labels = _coded(voxels.means, voxels.weights, count, settings.seed + frame)
    codes = OccupiedCodes(
        boxes=np.stack([centres, centres], axis=1),
        centres=centres,
        weights=masses_of(labels, voxels.weights, len(centres)),
        normals=normals_of(voxels.means, voxels.weights, labels, len(centres)),
        frames=np.full(len(centres), frame, np.int64),
    )
    kept = _between_cuts(centres, floor, settings)
    is_free = floor.heights(centres) <= settings.floor_height_m
    return codes.taken(kept & ~is_free), free_codes(centres[kept & is_free], frame)
