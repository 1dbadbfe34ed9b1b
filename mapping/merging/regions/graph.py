"""The regions of a map, their shapes, and the doors between them.

References
----------
Rotations by correlated directions of walls: Carpin, "Fast and accurate map merging for multi-robot systems",
Autonomous Robots 25, 2008.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.occupancy import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.merging.regions.segmentation import (
    NONE,
    Meetings,
    RegionSettings,
    clearance_of,
    find_meetings,
    free_space,
    split_regions,
)

QUARTER = math.pi / 2.0
BINS = 90
"""Bins of a histogram of directions, over a quarter turn."""

MIN_CONTRAST = 1.3
"""The likeliest rotation is so many times as likely as the mean, where walls have directions at all."""

LIKELY = 0.4
"""Rotations are tried that are likelier than the mean by this share of what the likeliest one is."""

_SMOOTH_CELLS, _SMOOTH_BINS = 2.0, 2.0
"""Standard deviations with which free space and histograms are smoothed [cells, bins]."""


class _Slopes(NamedTuple):
    """Slopes of free space at the cells next to walls: directions (n,) [rad] and regions (n,) int32."""

    directions: NDArray[np.float64]
    regions: NDArray[np.int32]


def _wall_slopes(levels: NDArray[np.uint8], free: NDArray[np.uint8], labels: NDArray[np.int32]) -> _Slopes:
    """Return across which directions walls run, at each cell of a region next to one.

    Parameters
    ----------
    levels, free, labels : (rows, columns) uint8, uint8, int32
        The three-level map, 1 if free, and its regions.
    """
    smooth = cv2.GaussianBlur(free.astype(np.float32), (0, 0), _SMOOTH_CELLS)
    is_wall = cv2.dilate((levels == OCCUPIED).astype(np.uint8), np.ones((3, 3), np.uint8))
    rows, columns = np.nonzero((is_wall > 0) & (labels != NONE))
    x, y = (cv2.Scharr(smooth, cv2.CV_32F, *order)[rows, columns] for order in ((1, 0), (0, 1)))
    return _Slopes(np.arctan2(y, x).astype(np.float64), labels[rows, columns])


def _region_axes(slopes: _Slopes, count: int) -> NDArray[np.float64]:
    """Return the direction of each region's walls from 0 to a quarter turn, of all if it has none."""
    # Fourfold angles are alike for all four directions of a rectangle's walls.
    around = np.exp(4j * slopes.directions)
    sums = np.bincount(slopes.regions, around.real, count) + 1j * np.bincount(slopes.regions, around.imag, count)
    sums[sums == 0.0] = around.sum()
    return np.asarray((np.angle(sums) / 4.0) % QUARTER)


def _direction_histogram(slopes: _Slopes) -> NDArray[np.float64]:
    """Return how many walls run in each direction of a quarter turn, smoothed, shape (`BINS`,)."""
    bins = (slopes.directions % QUARTER / QUARTER * BINS).astype(np.int64) % BINS
    distance = np.minimum(np.arange(BINS), BINS - np.arange(BINS))
    smoothing = np.exp(-0.5 * (distance / _SMOOTH_BINS) ** 2)
    return _circular(np.bincount(bins, minlength=BINS).astype(np.float64), smoothing)


def likely_rotations(a: NDArray[np.float64], b: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the rotations of map b under which its walls run along those of map a.

    Parameters
    ----------
    a, b : (`BINS`,) float64
        Directions of the maps' walls.
    count : int
        Of rotations around the circle; all of them if walls run in all directions.

    Returns
    -------
    (n,) float64
        Maximum number of rotations, the likeliest among them [rad].
    """
    alike = _circular(a, np.roll(b[::-1], 1))
    mean, most = float(alike.mean()), float(alike.max())
    every = np.arange(count, dtype=np.float64) * (2.0 * math.pi / count)
    if most < MIN_CONTRAST * mean or most == 0.0:
        return every
    rotations = every + float(alike.argmax()) / BINS * QUARTER
    values = alike[np.rint(rotations % QUARTER / QUARTER * BINS).astype(np.int64) % BINS]
    return np.asarray(rotations[values >= mean + LIKELY * (most - mean)])


def _circular(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the circular convolution of two arrays of one length."""
    return np.asarray(np.fft.irfft(np.fft.rfft(one) * np.fft.rfft(other), len(one)))


_WIDE_PART = 0.7
"""The middle of a door is that of the edges with so much of its most clearance."""


class Doors(NamedTuple):
    """Gaps between regions, (n,).

    Attributes
    ----------
    regions : (n, 2) int64
        The regions on both sides; one pair may have several doors.
    places : (n, 2) float64
        Middle of the gap, in the map's frame [m].
    normals : (n,) float64
        Direction through it, from the first region to the second [rad].
    widths : (n,) float64
        Width of the gap [m].
    """

    regions: NDArray[np.int64]
    places: NDArray[np.float64]
    normals: NDArray[np.float64]
    widths: NDArray[np.float64]


def _find_doors(met: Meetings, side: float) -> Doors:
    """Return the doors of a map, those between the first regions first.

    Parameters
    ----------
    met : Meetings
        Edges between cells of two regions.
    side : float
        Side of a cell [m].
    """
    is_turned = met.regions[:, 0] > met.regions[:, 1]
    pairs = np.sort(met.regions, axis=1).astype(np.int64)
    steps = np.where(is_turned[:, None], -met.steps, met.steps)
    regions, positions, normals, widths = [], [], [], []
    for pair in np.unique(pairs, axis=0):
        chosen = np.flatnonzero((pairs == pair).all(axis=1))
        parts = _connected(met.places[chosen])
        for part in range(parts.max() + 1):
            edges = chosen[parts == part]
            most = met.clearance[edges].max()
            middle = met.places[edges[met.clearance[edges] >= _WIDE_PART * most]].mean(axis=0)
            through = steps[edges].sum(axis=0)
            regions.append(pair)
            positions.append(middle * side)
            normals.append(np.arctan2(through[1], through[0]))
            # Clearance is that of a cell's middle: half a cell more or less on average.
            widths.append((2.0 * most - 0.5) * side)
    return Doors(
        np.array(regions, np.int64).reshape(-1, 2),
        np.array(positions).reshape(-1, 2),
        np.array(normals, np.float64),
        np.array(widths, np.float64),
    )


def _connected(places: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the number of the connected part to which each edge belongs, (n,)."""
    # Middles of edges lie on a grid of half cells; those of neighbouring cells are at most two apart.
    points = np.rint(2.0 * places).astype(np.int64)
    columns, rows = (points - points.min(axis=0) + 2).T
    drawn = np.zeros((rows.max() + 3, columns.max() + 3), np.uint8)
    drawn[rows, columns] = 1
    _, parts = cv2.connectedComponents(cv2.dilate(drawn, np.ones((3, 3), np.uint8)), connectivity=8)
    return np.asarray(parts[rows, columns], np.int64) - 1


_MAX_CELLS = 2000
"""About so many cells of a region show its extents."""

_RIM = 0.02
"""Share of a region's cells beyond each side of its box: niches and doorways."""

_SNAP = math.radians(25.0)
"""A door runs across the walls of its regions where its direction differs from theirs by less [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class RegionGraph:
    """Regions of a map's free space and the doors between them.

    Attributes
    ----------
    labels : (rows, columns) int32
        The region of each cell, or -1; row 0 at the lowest y.
    resolution : float
        Side of these cells [m].
    corner : (x, y)
        Lower left corner of cell (0, 0) in the map's frame [m].
    areas : (n,) float64
        Of each region [m2].
    axes : (n,) float64
        Direction of the walls of each, from 0 to a quarter turn [rad].
    low, high : (n, 2) float64
        Its box along its walls: in the map's frame turned by its axis [m].
    doors : Doors
        Through which regions meet.
    directions : (90,) float64
        How many walls run in each direction of a quarter turn.
    """

    labels: NDArray[np.int32]
    resolution: float
    corner: tuple[float, float]
    areas: NDArray[np.float64]
    axes: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    doors: Doors
    directions: NDArray[np.float64]

    def __len__(self) -> int:
        """Return the number of regions."""
        return len(self.areas)

    @property
    def extents(self) -> NDArray[np.float64]:
        """Length of each region along and across its axis, (n, 2) [m]."""
        return self.high - self.low

    @property
    def centres(self) -> NDArray[np.float64]:
        """Middle of each region's box in the map's frame, (n, 2) [m]."""
        return turned(0.5 * (self.low + self.high), self.axes)

    @property
    def door_counts(self) -> NDArray[np.int64]:
        """Number of doors of each region, (n,)."""
        return np.bincount(self.doors.regions.ravel(), minlength=len(self)).astype(np.int64)

    @property
    def adjacency(self) -> dict[int, list[int]]:
        """The regions that each meets through doors, in order."""
        found: dict[int, set[int]] = {region: set() for region in range(len(self))}
        for first, second in self.doors.regions.tolist():
            found[first].add(second)
            found[second].add(first)
        return {region: sorted(beside) for region, beside in found.items()}


def turned(points: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (n, 2), each turned by its angle (n,) about the origin."""
    cosine, sine = np.cos(angles), np.sin(angles)
    x, y = points[..., 0], points[..., 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


def find_regions(levels: NDArray[np.uint8], resolution: float, settings: RegionSettings) -> RegionGraph:
    """Return the regions of a map and their doors.

    Parameters
    ----------
    levels : (rows, columns) uint8
        The three-level map.
    resolution : float
        Side of its cells [m]; finer ones than the settings' are joined.
    settings : RegionSettings
        Rules for splitting regions.
    """
    known, corner = _cropped(levels)
    origin = np.array(corner) * resolution
    count = max(int(settings.cell_m / resolution + 1e-6), math.ceil(math.sqrt(known.size / settings.most_cells)))
    known, resolution = _joined(known, count), count * resolution
    free = free_space(known, round(settings.least_obstacle_m / resolution))
    clearance = clearance_of(free)
    labels = split_regions(clearance, resolution, settings)
    count = int(labels.max(initial=NONE)) + 1
    slopes = _wall_slopes(known, free, labels)
    axes = _region_axes(slopes, count)
    low, high = _boxes(labels, resolution, origin, axes)
    doors = _find_doors(find_meetings(labels, clearance), resolution)
    doors = doors._replace(places=doors.places + origin, normals=_snapped(doors, axes))
    areas = np.bincount(labels[labels != NONE], minlength=count).astype(np.float64) * resolution**2
    return RegionGraph(
        labels, resolution, tuple(origin.tolist()), areas, axes, low, high, doors, _direction_histogram(slopes)
    )


def _cropped(levels: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], tuple[int, int]]:
    """Return the known part of a map, and the column and row at which it begins."""
    is_known = levels != UNKNOWN
    rows, columns = np.flatnonzero(is_known.any(axis=1)), np.flatnonzero(is_known.any(axis=0))
    if len(rows) == 0:
        return levels[:1, :1], (0, 0)
    part = levels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return np.ascontiguousarray(part), (int(columns[0]), int(rows[0]))


def _joined(levels: NDArray[np.uint8], count: int) -> NDArray[np.uint8]:
    """Return a map in cells of a number of rows and columns: as `resampled`, in whole cells."""
    if count == 1:
        return levels
    rows, columns = (-(-side // count) for side in levels.shape)
    whole = np.full((rows * count, columns * count), UNKNOWN, np.uint8)
    whole[: levels.shape[0], : levels.shape[1]] = levels
    shares = [
        cv2.resize((whole == level).astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA)
        for level in (OCCUPIED, FREE)
    ]
    least = 0.5 / count**2
    joined = np.where(shares[1] > 0.5 * (1.0 - shares[0]) + 0.5 * least, FREE, UNKNOWN)
    return np.where(shares[0] > least, OCCUPIED, joined).astype(np.uint8)


def _boxes(
    labels: NDArray[np.int32], side: float, origin: NDArray[np.float64], axes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the boxes of regions along their axes, as low and high ends (n, 2) [m]."""
    cells = np.flatnonzero(labels != NONE)
    order = cells[np.argsort(labels.ravel()[cells], kind="stable")]
    ends = np.cumsum(np.bincount(labels.ravel()[cells], minlength=len(axes)))
    low, high = np.zeros((len(axes), 2)), np.zeros((len(axes), 2))
    for region, own in enumerate(np.split(order, ends[:-1]) if len(axes) else []):
        chosen = own[:: max(len(own) // _MAX_CELLS, 1)]
        positions = np.column_stack([chosen % labels.shape[1], chosen // labels.shape[1]]) + 0.5
        box = turned(positions * side + origin, np.full(len(chosen), -axes[region]))
        first, last = np.quantile(box, (_RIM, 1.0 - _RIM), axis=0)
        beyond = _RIM / (1.0 - 2.0 * _RIM) * (last - first)
        low[region], high[region] = first - beyond, last + beyond
    return low, high


def _snapped(doors: Doors, axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the directions of doors, across walls of their regions if they nearly are."""
    if len(doors.normals) == 0:
        return doors.normals
    quarter = math.pi / 2.0
    off = (doors.normals[:, None] - axes[doors.regions] + 0.5 * quarter) % quarter - 0.5 * quarter
    best = np.abs(off).argmin(axis=1)
    off = off[np.arange(len(best)), best]
    return np.where(np.abs(off) < _SNAP, doors.normals - off, doors.normals)
