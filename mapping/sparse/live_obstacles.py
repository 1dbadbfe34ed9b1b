"""What a live frame shows beside a map: boxes of obstacles that the map does not hold."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.sparse.mapper.code_merging import merged_codes
from lidarium.mapping.sparse.mapper.explained_points import are_covered
from lidarium.mapping.sparse.mapper.frame_coding import coded_obstacles, split_points
from lidarium.mapping.sparse.mapper.preprocessing import usable_points
from lidarium.mapping.sparse.rigid_motions import checked_poses, moved_points
from lidarium.mapping.sparse.sparse_map import SparseMap

LIVE_CODES = 32
"""Codes of what is new in a frame."""

MARGIN_M = 0.05
"""How near to a box of the map a point belongs to it [m]."""

LEAST_POINTS = 20
"""Points of a code that is an obstacle; fewer are noise."""


def live_obstacles(
    known: SparseMap,
    points: NDArray[np.floating],
    pose: NDArray[np.float64],
    count: int = LIVE_CODES,
    range_m: float = 4.0,
) -> NDArray[np.float64]:
    """Return boxes of what a frame shows and a map does not hold.

    Parameters
    ----------
    known : SparseMap
        The map.
    points : (N, 3) float
        Points in the frame [m].
    pose : (4, 4) float64
        Pose of the frame in the map.
    count : int
        How many codes, at most, before those whose boxes are mostly empty are cut.
    range_m : float
        Points farther from the sensor are left out [m].

    Returns
    -------
    (M, 2, 3) float64
        Low and high corners [m], for ``ChangingGraph.insert_all``; none where nothing is new.

    Raises
    ------
    ValueError
        Where the frame has no points within range, or the pose is no rigid motion.
    """
    cloud = moved_points(usable_points(points, range_m), checked_poses(pose))
    obstacles, _ = split_points(cloud, known.floor, known.settings)
    margin = np.array([-MARGIN_M, MARGIN_M])[:, None]
    new = obstacles[~are_covered(obstacles, known.boxes + margin)]
    codes = coded_obstacles(new, count, known.settings)
    codes = codes.taken(codes.weights >= LEAST_POINTS)
    return merged_codes(codes, known.free, known.settings)[0].boxes
