"""A sparse map: occupied codes with their boxes, free codes, poses of frames.

Codes keep the positions of the time at which their frame was coded. Results are moved by how the pose of the
frame has been corrected since, so that corrections never add up.

References
----------
Sparse mapper, section 4.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid_motions import checked_poses, inverse_of, moved_boxes, moved_points, turned
from lidarium.mapping.sparse.floor_plane import FloorPlane
from lidarium.mapping.sparse.seen_floor import SeenFloor
from lidarium.mapping.sparse.settings import MapperSettings

FLAT_SHARE = 0.25
"""Shortest side of a box over the next one, below which it is a surface."""

SQUARE_M2 = 0.05**2
"""Part of a face for which a box of which no points are known has a weight of one [m2]."""


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class OccupiedCodes:
    """Codes of the obstacles.

    Attributes
    ----------
    boxes : (M, 2, 3) float64
        Low and high corner of each code's points [m].
    centres : (M, 3) float64
        Weighted means of the points [m].
    weights : (M,) float64
        Points of each code.
    normals : (M, 3) float64
        Unit normals of the points' surfaces; zero if there is none.
    frames : (M,) int64
        Numbers of the frames that the codes come from.
    """

    boxes: NDArray[np.float64]
    centres: NDArray[np.float64]
    weights: NDArray[np.float64]
    normals: NDArray[np.float64]
    frames: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.boxes)

    def taken(self, places: NDArray[np.int64] | NDArray[np.bool_]) -> "OccupiedCodes":
        """Return some of the codes."""
        return OccupiedCodes(
            boxes=self.boxes[places],
            centres=self.centres[places],
            weights=self.weights[places],
            normals=self.normals[places],
            frames=self.frames[places],
        )

    def joined(self, other: "OccupiedCodes") -> "OccupiedCodes":
        """Return these codes, then others."""
        return OccupiedCodes(
            boxes=np.concatenate([self.boxes, other.boxes]),
            centres=np.concatenate([self.centres, other.centres]),
            weights=np.concatenate([self.weights, other.weights]),
            normals=np.concatenate([self.normals, other.normals]),
            frames=np.concatenate([self.frames, other.frames]),
        )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class FreeCodes:
    """Codes of the floor.

    Attributes
    ----------
    centres : (N, 3) float64
        Weighted means of the points [m].
    frames : (N,) int64
        Numbers of the frames that the codes come from.
    """

    centres: NDArray[np.float64]
    frames: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.centres)

    def taken(self, places: NDArray[np.int64] | NDArray[np.bool_]) -> "FreeCodes":
        """Return some of the codes."""
        return FreeCodes(centres=self.centres[places], frames=self.frames[places])

    def joined(self, other: "FreeCodes") -> "FreeCodes":
        """Return these codes, then others."""
        return FreeCodes(
            centres=np.concatenate([self.centres, other.centres]),
            frames=np.concatenate([self.frames, other.frames]),
        )


def occupied_codes(boxes: NDArray[np.float64], frame: int = 0) -> OccupiedCodes:
    """Return codes of which nothing but the boxes (M, 2, 3) [m] is known.

    Flat boxes are surfaces that face along their shortest side; the weight of a box is its largest face in squares
    of 5 cm, so that maps from files can be registered.
    """
    flat = np.ascontiguousarray(boxes, np.float64).reshape(-1, 2, 3)
    if not (np.isfinite(flat).all() and (flat[:, 0] <= flat[:, 1]).all()):
        raise ValueError("boxes are not low and high corners; want finite ones, low before high")
    count = len(flat)
    sizes = flat[:, 1] - flat[:, 0]
    ranked = np.sort(sizes, axis=1)
    normals = np.eye(3)[sizes.argmin(axis=1)] * (ranked[:, 0] < FLAT_SHARE * ranked[:, 1])[:, None]
    return OccupiedCodes(
        boxes=flat,
        centres=flat.mean(axis=1),
        weights=np.maximum(ranked[:, 1] * ranked[:, 2] / SQUARE_M2, 1.0),
        normals=normals,
        frames=np.full(count, frame, np.int64),
    )


def free_codes(centres: NDArray[np.float64], frame: int = 0) -> FreeCodes:
    """Return the free codes at points (N, 3) [m]."""
    points = np.ascontiguousarray(centres, np.float64).reshape(-1, 3)
    return FreeCodes(centres=points, frames=np.full(len(points), frame, np.int64))


@dataclass(frozen=True, eq=False, kw_only=True)
class SparseMap:
    """A robot's map of a place.

    Attributes
    ----------
    occupied : OccupiedCodes
        Codes of the obstacles, at the recorded positions in the map.
    ground : FreeCodes
        Codes of the floor, at the recorded positions in the map.
    poses : (F, 4, 4) float64
        Poses of the frames in the map, as they are known now.
    recorded : (F, 4, 4) float64
        Poses of the frames when they were coded.
    floor : FloorPlane
        The floor in the map.
    settings : MapperSettings
        How the map was made.
    seen_floor : SeenFloor or None
        Cells in which floor was seen; None if that is not known.
    """

    occupied: OccupiedCodes
    ground: FreeCodes
    poses: NDArray[np.float64] = field(default_factory=lambda: np.eye(4)[None])
    recorded: NDArray[np.float64] = field(default_factory=lambda: np.eye(4)[None])
    floor: FloorPlane = field(default_factory=FloorPlane)
    settings: MapperSettings = field(default_factory=MapperSettings)
    seen_floor: SeenFloor | None = None

    def __post_init__(self) -> None:
        if checked_poses(self.poses).shape != checked_poses(self.recorded).shape or self.poses.ndim != 3:
            raise ValueError(f"poses have shape {self.poses.shape}; want that of {len(self.recorded)} frames")
        frames = np.concatenate([self.occupied.frames, self.ground.frames])
        if len(frames) and not 0 <= frames.min() <= frames.max() < len(self.poses):
            raise ValueError(f"codes are of frames up to {frames.max()}; want numbers below {len(self.poses)}")

    @property
    def corrections(self) -> NDArray[np.float64]:
        """How each frame has moved since it was coded, (F, 4, 4)."""
        return np.asarray(self.poses @ inverse_of(self.recorded))

    @property
    def is_corrected(self) -> bool:
        """Whether any pose differs from that with which its frame was coded."""
        return not np.array_equal(self.poses, self.recorded)

    @property
    def boxes(self) -> NDArray[np.float64]:
        """Low and high corners of the occupied codes in the map, (M, 2, 3) [m]."""
        if not self.is_corrected:
            return self.occupied.boxes
        return moved_boxes(self.occupied.boxes, self.corrections[self.occupied.frames])

    @property
    def centres(self) -> NDArray[np.float64]:
        """Means of the occupied codes in the map, (M, 3) [m]."""
        return self._placed(self.occupied.centres, self.occupied.frames)

    @property
    def normals(self) -> NDArray[np.float64]:
        """Normals of the occupied codes in the map, (M, 3)."""
        if not self.is_corrected:
            return self.occupied.normals
        return turned(self.occupied.normals, self.corrections[self.occupied.frames])

    @property
    def free(self) -> NDArray[np.float64]:
        """Free codes in the map, (N, 3) [m]."""
        return self._placed(self.ground.centres, self.ground.frames)

    def moved(self, poses: NDArray[np.float64]) -> "SparseMap":
        """Return the map with other poses (F, 4, 4) of its frames; the cells of its floor are not known there."""
        return replace(self, poses=np.array(poses, np.float64), seen_floor=None)

    @property
    def current(self) -> OccupiedCodes:
        """The occupied codes at their current positions."""
        return replace(self.occupied, boxes=self.boxes, centres=self.centres, normals=self.normals)

    def recorded_codes(self, codes: OccupiedCodes, sources: NDArray[np.int64]) -> OccupiedCodes:
        """Return codes at the positions at which they would have been recorded.

        Parameters
        ----------
        sources : (M,) int64
            Which code of the map each of them is, -1 for none: those of the map do not become larger by being
            moved there and back.
        """
        if not self.is_corrected:
            return codes
        back = inverse_of(self.corrections)[codes.frames]
        known = sources >= 0
        boxes = moved_boxes(codes.boxes, back)
        boxes[known] = self.occupied.boxes[sources[known]]
        return replace(
            codes, boxes=boxes, centres=moved_points(codes.centres, back), normals=turned(codes.normals, back)
        )

    def _placed(self, points: NDArray[np.float64], frames: NDArray[np.int64]) -> NDArray[np.float64]:
        return moved_points(points, self.corrections[frames]) if self.is_corrected else points
