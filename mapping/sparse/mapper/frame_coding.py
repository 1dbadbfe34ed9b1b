"""Codes of one cloud: floor and obstacles apart, each with its points' box.

References
----------
Sparse mapper, section 4.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.graph.nodes import reduced_nodes
from lidarium.mapping.sparse.mapper.code_boxes import boxes_of, masses_of, means_of, normals_of
from lidarium.mapping.sparse.mapper.code_cutting import cut_labels
from lidarium.mapping.sparse.mapper.coding import coded
from lidarium.mapping.sparse.mapper.floor_split import is_floor
from lidarium.mapping.sparse.mapper.preprocessing import Voxels, voxels_of
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import FreeCodes, OccupiedCodes, free_codes, occupied_codes


def code_counts(count: int, floor_share: float) -> tuple[int, int]:
    """Return how many codes obstacles and floor get, of ``count``, at least one each.

    Raises
    ------
    ValueError
        Where there are fewer than two.
    """
    if not count >= 2:
        raise ValueError(f"k is {count}; want at least 2 codes, of floor and obstacles")
    on_floor = min(max(round(count * floor_share), 1), count - 1)
    return count - on_floor, on_floor


def between_cuts(
    points: NDArray[np.float64], floor: FloorPlane, settings: MapperSettings
) -> NDArray[np.bool_]:
    """Return which points (N, 3) are neither too deep nor too high, (N,) bool."""
    heights = floor.heights(points)
    return np.asarray((heights >= -settings.noise_depth_m) & (heights <= settings.ceiling_m))


def split_points(
    points: NDArray[np.float64], floor: FloorPlane, settings: MapperSettings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the points of obstacles and those of the floor, without what is cut off."""
    points = points[between_cuts(points, floor, settings)]
    if settings.split == "height":
        on_floor = is_floor(points, floor, settings)
    else:
        voxels = voxels_of(points, settings.voxel_m)
        on_floor = is_floor(voxels.means, floor, settings)[voxels.labels]
    return points[~on_floor], points[on_floor]


def coded_obstacles(
    points: NDArray[np.float64], count: int, settings: MapperSettings, frame: int = 0
) -> OccupiedCodes:
    """Return the codes of obstacles, each with the box of its points.

    Parameters
    ----------
    points : (N, 3) float64
        Points in the map [m].
    count : int
        How many codes, at most, before those whose boxes are mostly empty are cut.
    settings : MapperSettings
        How.
    frame : int
        The frame's number.
    """
    if len(points) == 0 or count < 1:
        return occupied_codes(np.empty((0, 2, 3)), frame)
    voxels, labels = labelled_voxels(points, count, settings, frame)
    if settings.merges:
        labels = cut_labels(voxels.means, labels, settings.voxel_m)
    return codes_of_labels(points, voxels, labels, frame)


def labelled_voxels(
    points: NDArray[np.float64], count: int, settings: MapperSettings, frame: int
) -> tuple[Voxels, NDArray[np.int64]]:
    """Return the voxels of points (N, 3) and the code of each, of at most ``count`` codes."""
    voxels = voxels_of(points, settings.voxel_m)
    return voxels, coded(voxels.means, voxels.weights, count, settings.seed + frame)[1]


def codes_of_labels(
    points: NDArray[np.float64], voxels: Voxels, labels: NDArray[np.int64], frame: int
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


def coded_floor(
    points: NDArray[np.float64], count: int, settings: MapperSettings, frame: int = 0
) -> FreeCodes:
    """Return at most so many codes of floor points (N, 3) [m], close ones merged."""
    if len(points) == 0 or count < 1:
        return free_codes(np.empty((0, 3)), frame)
    voxels = voxels_of(points, settings.voxel_m)
    centres, _ = coded(voxels.means, voxels.weights, count, settings.seed + frame)
    return free_codes(reduced_nodes(centres, settings.merge_radius_m), frame)


def coded_as_points(
    points: NDArray[np.float64], count: int, floor: FloorPlane, settings: MapperSettings, frame: int = 0
) -> tuple[OccupiedCodes, FreeCodes]:
    """Return codes as the thesis has them: points, split by their own height.

    Parameters
    ----------
    points : (N, 3) float64
        Points in the map [m].
    count : int
        How many codes.
    floor : FloorPlane
        The floor.
    settings : MapperSettings
        How.
    frame : int
        The frame's number.

    Returns
    -------
    OccupiedCodes
        Higher codes, with boxes of no size.
    FreeCodes
        Codes up to the height of the floor, that height included.
    """
    voxels = voxels_of(points, settings.voxel_m)
    centres, labels = coded(voxels.means, voxels.weights, count, settings.seed + frame)
    codes = OccupiedCodes(
        boxes=np.stack([centres, centres], axis=1),
        centres=centres,
        weights=masses_of(labels, voxels.weights, len(centres)),
        normals=normals_of(voxels.means, voxels.weights, labels, len(centres)),
        frames=np.full(len(centres), frame, np.int64),
    )
    kept = between_cuts(centres, floor, settings)
    is_free = floor.heights(centres) <= settings.floor_height_m
    return codes.taken(kept & ~is_free), free_codes(centres[kept & is_free], frame)
