"""Maps that grow frame by frame, from frames with known poses.

Only points that the map does not hold yet are coded: those outside its boxes, and floor away from its free
codes. So a place that is seen again adds nothing, and the map stays as large as the place.

References
----------
Sparse mapper, section 4, steps 1 and 2.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid_motions import checked_poses, inverse_of, moved_points
from lidarium.mapping.sparse.floor_plane import FloorPlane, find_floor
from lidarium.mapping.sparse.mapper.fitting import SeenPoints, fitted_codes
from lidarium.mapping.sparse.mapper.frame_coding import (
    code_counts,
    coded_as_points,
    coded_floor,
    coded_obstacles,
    split_points,
    usable_points,
    voxels_of,
)
from lidarium.mapping.sparse.mapper.merging import are_covered, are_near, merged_codes
from lidarium.mapping.sparse.seen_floor import FloorPoints
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.sparse_map import FreeCodes, OccupiedCodes, SparseMap, free_codes, occupied_codes


class IncrementalMapper:
    """Makes a map of clouds with poses, one after the other.

    Parameters
    ----------
    k : int
        Codes of a frame, at most, of floor and obstacles together.
    settings : MapperSettings or None
        Settings; if None, the defaults with a range of 4 m.
    floor : FloorPlane or None
        The floor in the map; None to find it in the first frame.

    Raises
    ------
    ValueError
        If k is too small.
    """

    def __init__(
        self, k: int = 256, settings: MapperSettings | None = None, *, floor: FloorPlane | None = None
    ) -> None:
        self.settings = settings or MapperSettings(range_m=4.0)
        self._counts = code_counts(k, self.settings.floor_share)
        self._floor = floor
        self._map: SparseMap | None = None
        keeps_floor = self.settings.floor_gap_m > 0.0 and self.settings.mode != "thesis"
        self._floor_points = FloorPoints(self.settings.floor_gap_m) if keeps_floor else None
        fits = self.settings.fits_boxes and self.settings.merges and self.settings.mode != "thesis"
        self._cells = SeenPoints() if fits else None
        self._is_fitted = True

    @property
    def map(self) -> SparseMap:
        """The map of all frames so far; which floor was seen is not known after a correction."""
        if self._map is None:
            raise ValueError("the map has no frame yet; want one to be added")
        if not self._is_fitted and self._cells is not None:
            frame = len(self._map.poses) - 1
            self._map = replace(self._map, occupied=fitted_codes(self._map.occupied, self._cells.middles, frame))
        if not self._is_fitted and self._floor_points is not None:
            seen = self._floor_points.seen(self._map.boxes, self._map.floor, self.settings.floor_height_m)
            self._map = replace(self._map, seen_floor=seen)
        self._is_fitted = True
        return self._map

    def is_due(self, pose: NDArray[np.float64]) -> bool:
        """Whether a frame with this pose (4, 4) is far from the last one taken."""
        if self._map is None:
            return True
        motion = inverse_of(self._map.poses[-1]) @ checked_poses(pose)
        turn = np.arccos(np.clip(0.5 * (np.trace(motion[:3, :3]) - 1.0), -1.0, 1.0))
        moved = float(np.linalg.norm(motion[:3, 3]))
        # Poses are given to so many digits.
        return moved >= self.settings.least_motion_m - 1e-9 or float(turn) >= self.settings.least_turn - 1e-9

    def add(self, points: NDArray[np.floating], pose: NDArray[np.float64]) -> bool:
        """Add a frame, if the robot has moved or turned enough since the last one.

        Parameters
        ----------
        points : (N, 3) float
            Points in the frame [m].
        pose : (4, 4) float64
            Pose of the frame in the map, whose z axis points up.
        """
        pose = checked_poses(pose)
        if not self.is_due(pose):
            return False
        settings = self.settings
        cloud = moved_points(usable_points(points, settings.range_m), pose)
        floor = self._floor
        if floor is None:
            floor = find_floor(voxels_of(cloud, max(settings.voxel_m, 0.02)).means, settings.floor, settings.seed)
        known = self._map or _empty_map(floor, settings)
        known = replace(
            known,
            poses=np.concatenate([known.poses, pose[None]]),
            recorded=np.concatenate([known.recorded, pose[None]]),
        )
        if settings.mode == "thesis":
            frame = len(known.poses) - 1
            occupied, ground = coded_as_points(cloud, sum(self._counts), floor, settings, frame)
            occupied, ground = known.occupied.joined(occupied), known.ground.joined(ground)
        else:
            occupied, ground = self._coded_frame(cloud, known, floor)
        self._floor = floor
        self._map = replace(known, occupied=occupied, ground=ground, seen_floor=None)
        self._is_fitted = False
        return True

    def correct(self, poses: NDArray[np.float64]) -> None:
        """Move the codes with corrected poses (F, 4, 4) of the frames that were taken."""
        self._map = self.map.moved(poses)
        # Points and cells are of the poses before.
        self._floor_points, self._cells = None, None

    def forget(self, gone: NDArray[np.bool_]) -> None:
        """Leave out occupied codes of the map that are no longer there, (M,) bool, and the points in them."""
        known = self.map
        self._map = replace(known, occupied=known.occupied.taken(~gone))
        if self._cells is not None:
            self._cells.drop(known.boxes[gone], self._map.boxes)

    def _coded_frame(
        self, cloud: NDArray[np.float64], known: SparseMap, floor: FloorPlane
    ) -> tuple[OccupiedCodes, FreeCodes]:
        """Return a map's codes, as recorded, with those of its last frame."""
        settings, frame = self.settings, len(known.poses) - 1
        obstacles, on_floor = split_points(cloud, floor, settings)
        if self._floor_points is not None:
            self._floor_points.add(on_floor, floor)
        if self._cells is not None:
            self._cells.add(obstacles)
        obstacles = obstacles[~are_covered(obstacles, known.boxes)]
        on_floor = on_floor[~are_near(on_floor, known.free, settings.merge_radius_m)]
        found = coded_floor(on_floor, self._counts[1], settings, frame)
        # Of points around a free code the mean may lie on it.
        found = found.taken(~are_near(found.centres, known.free, settings.merge_radius_m))
        ground = known.ground.joined(found)
        recorded = known.occupied.joined(coded_obstacles(obstacles, self._counts[0], settings, frame))
        grown = replace(known, occupied=recorded, ground=ground)
        occupied, sources = merged_codes(grown.current, grown.free, settings)
        return grown.recorded_codes(occupied, sources), ground


def _empty_map(floor: FloorPlane, settings: MapperSettings) -> SparseMap:
    return SparseMap(
        occupied=occupied_codes(np.empty((0, 2, 3))),
        ground=free_codes(np.empty((0, 3))),
        poses=np.empty((0, 4, 4)),
        recorded=np.empty((0, 4, 4)),
        floor=floor,
        settings=settings,
    )
