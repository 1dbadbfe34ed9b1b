"""Estimation of the bend between two maps: many local alignments that hold each other.

Each wall of map b seeks along its normal a wall of map a that faces the same direction. The offsets at
the nodes of a coarse grid are those that bring walls onto walls, with springs between neighbouring nodes.
They follow the walls if many agree, and stay with their neighbours otherwise.

References
----------
Non-rigid alignment by a stiff deformation graph: Sumner, Schmid, Pauly, "Embedded deformation for shape
manipulation", ACM Transactions on Graphics 26, 2007.
"""

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import scipy
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import Count, Distance, FromZero, check_settings, within
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.geometry.small_matrices import inverse, product
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.merging.described_map import DescribedMap
from lidarium.mapping.merging.wall_alignment import gap_to_wall, wall_sample


@kernel
def _find_gaps(
    levels: Array,
    distance: Array,
    side: float,
    places: Array,
    normals: Array,
    reach: float,
    gaps: Array,
    found: Array,
) -> None:
    """Write the gap along the normal from each place to a wall [m], and whether there is one in reach."""
    steps = int(reach / side)
    for i in range(places.shape[0]):
        gap = gap_to_wall(
            levels,
            distance,
            side,
            places[i, 0] / side,
            places[i, 1] / side,
            normals[i, 0],
            normals[i, 1],
            steps,
        )
        found[i] = gap <= steps
        gaps[i] = gap * side if found[i] else 0.0


@kernel
def _add_walls(
    nodes: Array,
    weights: Array,
    normals: Array,
    offsets: Array,
    gaps: Array,
    trust: Array,
    band: Array,
    right: Array,
) -> None:
    """Add to normal equations that the offsets along each wall's normal shall close its gap.

    The band holds the lower triangle: entry (i, j) is at (i - j, j).
    """
    for i in range(nodes.shape[0]):
        if trust[i] == 0.0:
            continue
        wanted = gaps[i]
        for j in range(4):
            for axis in range(2):
                wanted += weights[i, j] * normals[i, axis] * offsets[nodes[i, j], axis]
        for j in range(4):
            for axis in range(2):
                row = 2 * nodes[i, j] + axis
                left = trust[i] * weights[i, j] * normals[i, axis]
                right[row] += left * wanted
                for k in range(4):
                    for other in range(2):
                        column = 2 * nodes[i, k] + other
                        if column <= row:
                            band[row - column, column] += left * weights[i, k] * normals[i, other]


@kernel
def _add_springs(columns: int, strength: float, band: Array) -> None:
    """Add springs between the neighbouring nodes of a grid to a band."""
    count = band.shape[1] // 2
    for node in range(count):
        for step in (1, columns):
            other = node + step
            if other < count and (step > 1 or columns == 1 or other % columns != 0):
                for axis in range(2):
                    band[0, 2 * node + axis] += strength
                    band[0, 2 * other + axis] += strength
                    band[2 * step, 2 * node + axis] -= strength
            if columns == 1:
                break


@dataclass(frozen=True, slots=True, eq=False)
class OffsetField:
    """Offsets of a map's points from a rigid motion.

    Attributes
    ----------
    corner : (x, y)
        The first node, in the map that is bent [m].
    spacing_m : float
        Between nodes, along both axes [m].
    offsets : (rows, columns, 2) float64
        At the nodes, along the axes of the other map [m].
    """

    corner: tuple[float, float]
    spacing_m: float
    offsets: NDArray[np.float64]

    def at(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the offsets of points (n, 2) of the bent map [m]; beyond the grid those of its rim."""
        found = np.empty((len(points), 2))
        _interpolate(np.ascontiguousarray(points), self.corner, self.spacing_m, self.offsets, found)
        return found

    def bent(self, a_from_b: Transform, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (n, 2) of the bent map b in map a [m]."""
        return np.asarray(a_from_b.apply(points) + self.at(points))

    def unbent(self, a_from_b: Transform, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points (n, 2) of map a in the bent map b [m].

        Offsets change by a small share of the distance, so that two steps are exact to a millimetre.
        """
        back = a_from_b.inverse()
        found = back.apply(points)
        for _ in range(2):
            found = back.apply(points - self.at(found))
        return np.asarray(found)


def _bilinear(
    points: NDArray[np.float64], corner: tuple[float, float], spacing: float, shape: tuple[int, ...]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the four nodes around each point and their weights, both (n, 4)."""
    rows, columns = shape
    position = (points - corner) / spacing
    x, y = np.clip(position[:, 0], 0.0, columns - 1.0), np.clip(position[:, 1], 0.0, rows - 1.0)
    left = np.minimum(x.astype(np.int64), max(columns - 2, 0))
    low = np.minimum(y.astype(np.int64), max(rows - 2, 0))
    u, v = x - left, y - low
    right, high = np.minimum(left + 1, columns - 1), np.minimum(low + 1, rows - 1)
    nodes = np.stack(
        [low * columns + left, low * columns + right, high * columns + left, high * columns + right], axis=1
    )
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=1)
    return nodes, weights


@kernel
def _interpolate(points: Array, corner: tuple[float, float], spacing: float, offsets: Array, found: Array) -> None:
    """Write the bilinear offsets of points; `bilinear` is the plain form."""
    rows, columns = offsets.shape[0], offsets.shape[1]
    for i in range(points.shape[0]):
        x = min(max((points[i, 0] - corner[0]) / spacing, 0.0), columns - 1.0)
        y = min(max((points[i, 1] - corner[1]) / spacing, 0.0), rows - 1.0)
        left, low = min(int(x), max(columns - 2, 0)), min(int(y), max(rows - 2, 0))
        right, high = min(left + 1, columns - 1), min(low + 1, rows - 1)
        u, v = x - left, y - low
        for axis in range(2):
            lower = (1.0 - u) * offsets[low, left, axis] + u * offsets[low, right, axis]
            upper = (1.0 - u) * offsets[high, left, axis] + u * offsets[high, right, axis]
            found[i, axis] = (1.0 - v) * lower + v * upper


INDEPENDENT_M, BENT_ALIKE_M = 0.5, 15.0
"""Lengths of wall that err alike by noise, and by a bend [m].

The latter so that 86 % of errors of half of the maps of real robots are within two standard deviations.
"""

MIN_SPREAD_M = 0.01
"""Error of maps without any bend [m]."""

ANCHOR = 1e-3
"""Weight of offsets themselves beside the gaps of the walls of a node: they are zero where nothing holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BendSettings:
    """How much one map may be bent against another.

    Attributes
    ----------
    spacing_m : float, default 3.0
        Between the nodes of the grid of offsets [m]; more if there would be more than ``most_nodes``.
    most_nodes : int, default 14
        Along a side of the grid.
    reach_m : float, default 0.6
        How far a wall seeks another at first [m].
    last_reach_m : float, default 0.2
        How far at last [m].
    stiffness : float, default 0.1
        Weight of the difference of two neighbouring offsets against the gaps of the walls of a node.
    rounds, samples : int, default 6, 1500
        Number of rounds, and of wall cells that are aligned.
    candidates : int, default 16
        Number of transforms that are tried with a bend if none is believed without; 0 for maps that are
        not bent.
    proposals : int, default 6
        Number of transforms of a coarse search over all rotations and translations that are tried beside
        these.
    """

    spacing_m: Distance = 3.0
    most_nodes: Count = 14
    reach_m: Distance = 0.6
    last_reach_m: Distance = 0.2
    stiffness: FromZero = 0.1
    rounds: Count = 6
    samples: Count = 1500
    candidates: Annotated[int, within(0, 1000)] = 16
    proposals: Annotated[int, within(0, 1000)] = 6

    def __post_init__(self) -> None:
        check_settings(self, "bend")


@dataclass(frozen=True, slots=True, eq=False)
class Bend:
    """How map b lies in map a, and how it is bent there.

    Attributes
    ----------
    a_from_b : Transform
        The rigid motion that comes nearest to it.
    field : OffsetField
        The rest.
    bend_m : float
        Root mean square of the offsets at the walls that agree [m].
    strain : float
        Root mean square of how offsets change with distance [1].
    spread_m : float
        Spread of the gaps between walls that is left, as a standard deviation [m].
    scale : float
        By how much map b would have to grow to fit best.
    covariance : (3, 3) float64
        Of x, y [m2] and theta [rad2] of the motion, about the middle of the walls that agree.
    growth_m : float
        Root mean square of what the scale explains of the offsets [m].
    middle : (2,) float64
        That middle in map a [m].
    """

    a_from_b: Transform
    field: OffsetField
    bend_m: float
    strain: float
    spread_m: float
    scale: float
    covariance: NDArray[np.float64]
    growth_m: float = 0.0
    middle: NDArray[np.float64] = dataclasses.field(default_factory=lambda: np.zeros(2))

    @property
    def is_held(self) -> bool:
        """Whether walls hold the maps on each other at all."""
        return bool(np.isfinite(self.covariance).all())

    @property
    def growth_share(self) -> float:
        """Share of the squared offsets that the scale explains, from 0 to 1."""
        return min((self.growth_m / self.bend_m) ** 2, 1.0) if self.bend_m > 0.0 else 0.0


def estimate_bend(a: DescribedMap, b: DescribedMap, a_from_b: Transform, settings: BendSettings) -> Bend:
    """Return how map b is bent against map a near a rigid motion."""
    sample = wall_sample(len(b.walls), settings.samples)
    walls = b.walls[sample]
    normals = _turned(a_from_b, b.normals[sample])
    low, high = b.walls.min(axis=0), b.walls.max(axis=0)
    spacing = max(settings.spacing_m, float((high - low).max()) / max(settings.most_nodes - 1, 1))
    columns, rows = (int(count) for count in np.ceil((high - low) / spacing - 1e-9).astype(np.int64) + 1)
    corner = (float(low[0]), float(low[1]))
    nodes, weights = _bilinear(walls, corner, spacing, (rows, columns))
    offsets = np.zeros((rows * columns, 2))
    start = a_from_b.apply(walls)
    gaps, found = np.zeros(len(walls)), np.zeros(len(walls), np.bool_)
    for step in range(settings.rounds):
        share = min(1.5 * step / settings.rounds, 1.0)
        reach = settings.reach_m * (settings.last_reach_m / settings.reach_m) ** share
        reach = max(reach, 2.0 * a.resolution)
        positions = start + (weights[..., None] * offsets[nodes]).sum(axis=1)
        _find_gaps(a.levels, a.distance, a.resolution, positions, normals, reach, gaps, found)
        if found.sum() < 3:
            break
        offsets = _solved(nodes, weights, normals, offsets, (gaps, found, reach), (columns, settings.stiffness))
    positions = start + (weights[..., None] * offsets[nodes]).sum(axis=1)
    _find_gaps(a.levels, a.distance, a.resolution, positions, normals, settings.last_reach_m, gaps, found)
    field = OffsetField(corner, spacing, offsets.reshape(rows, columns, 2))
    wall_m = b.resolution * len(b.walls) / max(len(sample), 1)
    return _described(a_from_b, field, (walls, normals, gaps), found, wall_m, max(a.resolution, b.resolution))


def _turned(transform: Transform, normals: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(Transform(0.0, 0.0, transform.theta).apply(normals))


def _solved(
    nodes: NDArray[np.int64],
    weights: NDArray[np.float64],
    normals: NDArray[np.float64],
    offsets: NDArray[np.float64],
    seen: tuple[NDArray[np.float64], NDArray[np.bool_], float],
    springs: tuple[int, float],
) -> NDArray[np.float64]:
    """Return the offsets that close the gaps, held by springs between neighbours.

    The springs are given by the number of columns of the grid, and their strength. The normal equations are
    kept as a band: nodes are numbered by rows, and only neighbours have to do with each other.
    """
    (gaps, found, reach), (columns, stiffness), count = seen, springs, len(offsets)
    # Large gaps count less: they may lead to another wall.
    trust = np.where(found, 1.0 / (1.0 + (2.0 * gaps / reach) ** 2), 0.0)
    band, right = np.zeros((2 * columns + 4, 2 * count)), np.zeros(2 * count)
    _add_walls(nodes, weights, normals, offsets, gaps, trust, band, right)
    # The springs are as strong as the walls of a node.
    strength = trust.sum() / count
    _add_springs(columns, stiffness * strength, band)
    band[0] += ANCHOR * strength
    return np.asarray(scipy.linalg.solveh_banded(band, right, lower=True).reshape(count, 2))


def _described(
    a_from_b: Transform,
    field: OffsetField,
    seen: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    found: NDArray[np.bool_],
    wall_m: float,
    side: float,
) -> Bend:
    """Return the result for the nearest rigid motion; a sampled cell represents a length of wall.

    Walls of both maps are drawn to about a cell, whose side is given, by programs of their own: all may err alike.
    """
    walls, normals, gaps = seen
    if found.sum() < 3:
        return Bend(a_from_b, field, 0.0, 0.0, 0.0, 1.0, np.diag([np.inf] * 3))
    held = walls[found]
    target = field.bent(a_from_b, held)
    nearest, scale = _nearest_motion(held, target)
    rows, columns, _ = field.offsets.shape
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    positions = np.asarray(field.corner) + grid * field.spacing_m
    left = (field.bent(a_from_b, positions) - nearest.apply(positions)).reshape(rows, columns, 2)
    rest = OffsetField(field.corner, field.spacing_m, left)
    steps = np.concatenate([np.diff(left, axis=0).reshape(-1, 2), np.diff(left, axis=1).reshape(-1, 2)])
    strain = float(np.sqrt((steps**2).sum(axis=1).mean())) / field.spacing_m if len(steps) else 0.0
    bend_m = float(np.sqrt((rest.at(held) ** 2).sum(axis=1).mean()))
    spread = math.sqrt(0.5 * math.pi) * float(np.abs(gaps[found]).mean())
    variance = spread**2 + MIN_SPREAD_M**2 + BENT_ALIKE_M / INDEPENDENT_M * bend_m**2
    middle = target.mean(axis=0)
    covariance = _covariance(target - middle, normals[found], variance, wall_m)
    covariance += np.diag([side**2, side**2, 0.0])
    growth_m = abs(scale - 1.0) * float(np.sqrt(((held - held.mean(axis=0)) ** 2).sum(axis=1).mean()))
    return Bend(nearest, rest, bend_m, strain, spread, scale, covariance, growth_m, middle)


def _nearest_motion(points: NDArray[np.float64], target: NDArray[np.float64]) -> tuple[Transform, float]:
    """Return the rigid motion that brings points nearest to others, and the scale that would help it."""
    centre, there = points.mean(axis=0), target.mean(axis=0)
    p, q = points - centre, target - there
    along, across = float((p * q).sum()), float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum())
    turn = Transform(0.0, 0.0, math.atan2(across, along))
    x, y = (there - turn.apply(centre)).tolist()
    return Transform(x, y, turn.theta), math.hypot(along, across) / max(float((p**2).sum()), 1e-12)


def _covariance(
    places: NDArray[np.float64], normals: NDArray[np.float64], variance: float, wall_m: float
) -> NDArray[np.float64]:
    """Return the covariance of a motion that walls hold along their normals.

    Neighbouring cells of a wall err alike: `INDEPENDENT_M` of wall are one measurement.
    """
    turns = places[:, 0] * normals[:, 1] - places[:, 1] * normals[:, 0]
    rows = np.column_stack([normals, turns])
    information = product(rows.T, rows) * (wall_m / INDEPENDENT_M / variance)
    return inverse(information + 1e-6 * np.eye(3))
