"""Maps of whole clouds, coded once.

References
----------
Sparse mapper, section 1, *full reconstruction*.
"""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid_motions import checked_poses, moved_points
from lidarium.mapping.sparse.floor_plane import FloorPlane, find_floor
from lidarium.mapping.sparse.mapper.fitting import SeenPoints, fitted_codes
from lidarium.mapping.sparse.mapper.frame_coding import (
    code_counts,
    coded_as_points,
    coded_floor,
    codes_of_labels,
    cut_labels,
    labelled_voxels,
    split_points,
    usable_points,
    voxels_of,
)
from lidarium.mapping.sparse.mapper.merging import merged_codes
from lidarium.mapping.sparse.seen_floor import FloorPoints, SeenFloor
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import OccupiedCodes, SparseMap, occupied_codes


def map_cloud(
    points: NDArray[np.floating],
    k: int,
    settings: MapperSettings | None = None,
    *,
    pose: NDArray[np.float64] | None = None,
    floor: FloorPlane | None = None,
) -> SparseMap:
    """Make a sparse map of a point cloud: boxes of obstacles, and nodes on free floor.

    Use it to plan for bodies of any height (`build_graph`, `plan`) with a few kilobytes instead of a cloud.

    Parameters
    ----------
    points : (N, 3) float
        The cloud [m].
    k : int
        Number of codes, of floor and obstacles together; merging leaves fewer, and boxes that would be mostly empty
        become several.
    settings : MapperSettings, optional
        Settings; defaults if None.
    pose : (4, 4) float64, optional
        Pose of the cloud in the map, whose z axis points up; by default the identity.
    floor : FloorPlane, optional
        The floor in the map; by default it is found.

    Returns
    -------
    SparseMap
        The map, of one frame.

    Raises
    ------
    ValueError
        If there are no points, they are not in metres, no floor is found, or k is too small.

    Examples
    --------
    >>> import lidarium, numpy as np
    >>> x, y = np.meshgrid(np.arange(0.0, 4.0, 0.05), np.arange(0.0, 3.0, 0.05))
    >>> floor = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    >>> room = lidarium.map_cloud(np.concatenate([floor, floor[:400] + (0.0, 0.0, 0.5)]), k=64)
    >>> room.boxes.shape[1:], room.free.shape[1:]
    ((2, 3), (3,))
    """
    settings = settings or MapperSettings()
    pose = np.eye(4) if pose is None else checked_poses(pose)
    on_obstacles, on_floor = code_counts(k, settings.floor_share)
    cloud = moved_points(usable_points(points, settings.range_m), pose)
    if floor is None:
        floor = find_floor(voxels_of(cloud, max(settings.voxel_m, 0.02)).means, settings.floor, settings.seed)
    seen: SeenFloor | None = None
    if settings.mode == "thesis":
        occupied, ground = coded_as_points(cloud, k, floor, settings)
    else:
        obstacles, ground_points = split_points(cloud, floor, settings)
        ground = coded_floor(ground_points, on_floor, settings)
        occupied = _merged_obstacles(obstacles, on_obstacles, ground.centres, settings)
        if settings.fits_boxes and settings.merges:
            cells = SeenPoints()
            cells.add(obstacles)
            occupied = fitted_codes(occupied, cells.middles)
        if settings.floor_gap_m > 0.0:
            floor_points = FloorPoints(settings.floor_gap_m)
            floor_points.add(ground_points, floor)
            seen = floor_points.seen(occupied.boxes, floor, settings.floor_height_m)
    return SparseMap(
        occupied=occupied,
        ground=ground,
        poses=pose[None].copy(),
        recorded=pose[None].copy(),
        floor=floor,
        settings=settings,
        seen_floor=seen,
    )


def _merged_obstacles(
    points: NDArray[np.float64], count: int, free: NDArray[np.float64], settings: MapperSettings
) -> OccupiedCodes:
    """Return at most a number of codes of obstacles: those that merging saves go to boxes that are cut."""
    if len(points) == 0:
        return occupied_codes(np.empty((0, 2, 3)))
    voxels, labels = labelled_voxels(points, count, settings, 0)
    merged, _ = merged_codes(codes_of_labels(points, voxels, labels, 0), free, settings)
    cuts = count - len(merged)
    while settings.merges and cuts > 0:
        pieces = cut_labels(voxels.means, labels, settings.voxel_m, cuts)
        cut, _ = merged_codes(codes_of_labels(points, voxels, pieces, 0), free, settings)
        if len(cut) <= count:
            return cut
        cuts //= 2
    return merged
