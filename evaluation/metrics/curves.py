"""Agreement of a map of curves with the true walls, and the map's size.

References
----------
Precision and recall of curves within a tolerance: as boundaries are compared in image segmentation (Martin et
al., PAMI 2004).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lidarium.mapping.kernels.compilation import Array, kernel

TOLERANCE = 0.05
"""Within this distance a curve shows a wall [m]."""

Points = NDArray[np.float64]
Edges = NDArray[np.float64]
"""Walls as x1, y1, x2, y2, (edges, 4) float64 [m]."""


@dataclass(frozen=True, slots=True)
class _WallError:
    """Distance of points of curves from the nearest wall: mean and 95 % quantile [m].

    Nan if there are no points.
    """

    mean: float
    p95: float


def distances_to_walls(points: Points, edges: Edges) -> NDArray[np.float64]:
    """Return the distance of each point (n, 2) from the nearest wall, (n,) [m]."""
    if len(edges) == 0:
        raise ValueError("there are no walls; want at least one edge")
    distances = np.empty(len(points))
    _distances(np.ascontiguousarray(points, np.float64), np.ascontiguousarray(edges, np.float64), distances)
    return distances


def wall_error(curve_points: Points, edges: Edges) -> _WallError:
    """Return how far points along the curves (n, 2) lie from the nearest wall.

    The points lie evenly along the curves.
    """
    if len(curve_points) == 0:
        return _WallError(float("nan"), float("nan"))
    distances = distances_to_walls(curve_points, edges)
    return _WallError(float(distances.mean()), float(np.quantile(distances, 0.95)))


def curve_precision(curve_points: Points, edges: Edges, tolerance: float = TOLERANCE) -> float:
    """Return the share of the curves' length within a tolerance of a wall.

    1 if there are no curves.

    Parameters
    ----------
    curve_points : (n, 2) float64
        Points evenly along the curves [m].
    edges : (edges, 4) float64
        All walls.
    """
    return float(np.mean(distances_to_walls(curve_points, edges) <= tolerance)) if len(curve_points) else 1.0


def wall_recall(wall_points: Points, curve_points: Points, tolerance: float = TOLERANCE) -> float:
    """Return the share of seen walls within a tolerance of a curve.

    1 if nothing was seen.

    Parameters
    ----------
    wall_points : (n, 2) float64
        Points evenly along the walls that were seen, such as those of `seen_walls` [m].
    curve_points : (m, 2) float64
        Points along the curves, no farther apart than the tolerance [m].
    """
    if len(wall_points) == 0:
        return 1.0
    if len(curve_points) == 0:
        return 0.0
    return float(np.mean(cKDTree(curve_points).query(wall_points)[0] <= tolerance))


def seen_walls(edges: Edges, hits: Points, spacing: float = 0.02, reach: float = 0.05) -> Points:
    """Return points on walls at which beams have ended, shape (n, 2) [m].

    The points lie evenly along the walls.

    Parameters
    ----------
    edges : (edges, 4) float64
        Walls.
    hits : (m, 2) float64
        Ends of beams from true poses, before noise, as `hits_of_beams` gives them [m].
    """
    if len(hits) == 0:
        return np.empty((0, 2))
    points = [np.empty((0, 2))]
    for edge in np.asarray(edges, np.float64):
        length = float(np.hypot(*(edge[2:] - edge[:2])))
        shares = (np.arange(max(round(length / spacing), 1)) + 0.5) / max(round(length / spacing), 1)
        points.append(edge[:2] + shares[:, None] * (edge[2:] - edge[:2]))
    along = np.concatenate(points)
    return np.asarray(along[cKDTree(hits).query(along)[0] <= reach])


def hits_of_beams(edges: Edges, poses: Points, angles: NDArray[np.float64], range_max: float) -> Points:
    """Return the end points of the beams of scans from true poses, before noise, (n, 2) [m].

    Parameters
    ----------
    edges : (edges, 4) float64
        Walls.
    poses : (scans, 3) float64
        True poses of the laser x, y, theta [m, rad].
    angles : (beams,) float64
        Angles of the beams against the heading [rad].
    """
    hits = np.empty((len(poses) * len(angles), 2))
    count = _cast(
        np.ascontiguousarray(edges, np.float64),
        np.ascontiguousarray(poses, np.float64),
        angles,
        range_max,
        hits,
    )
    return hits[:count].copy()


def end_point_bytes(points: int) -> int:
    """Return the size of raw end points as two float32 each [bytes]."""
    return 8 * points


def grid_bytes(bounds: tuple[float, float, float, float], resolution: float = 0.05) -> int:
    """Return the size of a grid of one byte a cell [bytes].

    The grid covers x_min, y_min, x_max, y_max.
    """
    x_min, y_min, x_max, y_max = bounds
    return int(np.ceil((x_max - x_min) / resolution - 1e-9)) * int(np.ceil((y_max - y_min) / resolution - 1e-9))


@kernel
def _distances(points: Array, edges: Array, distances: Array) -> None:
    for k in range(points.shape[0]):
        nearest = np.inf
        for e in range(edges.shape[0]):
            dx, dy = edges[e, 2] - edges[e, 0], edges[e, 3] - edges[e, 1]
            x, y = points[k, 0] - edges[e, 0], points[k, 1] - edges[e, 1]
            squared = dx * dx + dy * dy
            share = min(max((x * dx + y * dy) / squared, 0.0), 1.0) if squared > 0.0 else 0.0
            nearest = min(nearest, (x - share * dx) ** 2 + (y - share * dy) ** 2)
        distances[k] = np.sqrt(nearest)


@kernel
def _cast(edges: Array, poses: Array, angles: Array, range_max: float, hits: Array) -> int:
    count = 0
    for p in range(poses.shape[0]):
        for b in range(angles.shape[0]):
            cosine, sine = np.cos(poses[p, 2] + angles[b]), np.sin(poses[p, 2] + angles[b])
            nearest = np.inf
            for e in range(edges.shape[0]):
                dx, dy = edges[e, 2] - edges[e, 0], edges[e, 3] - edges[e, 1]
                x, y = edges[e, 0] - poses[p, 0], edges[e, 1] - poses[p, 1]
                across = cosine * dy - sine * dx
                if across != 0.0:
                    distance, share = (x * dy - y * dx) / across, (x * sine - y * cosine) / across
                    if 0.0 <= share <= 1.0 and 0.0 < distance < nearest:
                        nearest = distance
            if nearest <= range_max:
                hits[count, 0], hits[count, 1] = poses[p, 0] + nearest * cosine, poses[p, 1] + nearest * sine
                count += 1
    return count
