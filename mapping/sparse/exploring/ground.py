"""Ground that a depth camera has seen, and the map that is made of it."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid_motions import inverse_of, moved_points
from lidarium.mapping.grids.growing_array import GrowingArray
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.planning.frontiers.frontier_map import Clusters, FrontierMap
from lidarium.mapping.point_clouds.cameras import Intrinsics
from lidarium.mapping.sparse.swept_body import SweptBody

FX, FY, CX, CY = range(4)
"""Places in the numbers of a pinhole."""

RANGE, LOWEST, HIGHEST, SHORTFALL = range(4)
"""Places in the limits of a camera."""


class _CameraNumbers(NamedTuple):
    """A camera as kernels take it.

    Attributes
    ----------
    pinhole : (4,) float64
        Focal lengths and principal point [pixels].
    pose : (3, 4) float64
        Maps points of the optical frame into the robot's [m].
    limits : (4,) float64
        Range, the heights between which a point counts as ground, and how far before the place it may be
        where its ray meets the plane of the ground [m].
    """

    pinhole: Annotated[Array, np.float64, 1]
    pose: Annotated[Array, np.float64, 2]
    limits: Annotated[Array, np.float64, 1]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class GroundCamera:
    """A depth camera on a robot, as far as the ground is concerned.

    Attributes
    ----------
    intrinsics : Intrinsics
        Of the camera.
    pose : (4, 4) float64
        Maps points of the optical frame into the robot's, whose origin is on the ground [m].
    shape : (int, int)
        Rows and columns of an image.
    range_m : float
        Points farther from the camera are not used [m].
    lowest_m, highest_m : float
        Heights between which a point counts as ground [m].
    shortfall_m : float
        How far it may be, along the ground, before the place where its ray meets the plane of the ground: the
        foot of a wall hides the ground behind it [m].
    """

    intrinsics: Intrinsics
    pose: NDArray[np.float64]
    shape: tuple[int, int]
    range_m: float
    lowest_m: float = -0.1
    highest_m: float = 0.1
    shortfall_m: float = 0.1

    def __post_init__(self) -> None:
        if not self.nearest_m < self.farthest_m:
            raise ValueError(
                f"the camera at a height of {self.height_m:g} m sees the ground only from "
                f"{self.nearest_m:.3g} m on, beyond its range of {self.range_m:g} m; want it to point "
                "farther down: a larger pitch"
            )

    @property
    def height_m(self) -> float:
        """Height of the optical centre above the ground [m]."""
        return float(self.pose[2, 3])

    @property
    def numbers(self) -> _CameraNumbers:
        """The camera as kernels take it."""
        pinhole = self.intrinsics
        return _CameraNumbers(
            np.array([pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy]),
            np.ascontiguousarray(self.pose[:3], np.float64),
            np.array([self.range_m, self.lowest_m, self.highest_m, self.shortfall_m]),
        )

    @property
    def nearest_m(self) -> float:
        """Distance from the robot at which the lowest row sees the ground [m]; inf if it does not."""
        return self._ground_distance(self.shape[0] - 1)

    @property
    def farthest_m(self) -> float:
        """Distance from the robot up to which the camera sees the ground [m]."""
        level = math.sqrt(max(self.range_m**2 - self.height_m**2, 0.0))
        return min(level, self._ground_distance(0))

    @property
    def bearing(self) -> float:
        """Direction of the axis from the robot's heading [rad]."""
        return math.atan2(self.pose[1, 2], self.pose[0, 2])

    @property
    def half_angle(self) -> float:
        """Half of the angle that an image covers [rad]."""
        return math.atan(0.5 * self.shape[1] / self.intrinsics.fx)

    def _ground_distance(self, row: int) -> float:
        """Return how far from the robot the middle of an image row meets the ground [m]."""
        ray = np.array([0.0, (row - self.intrinsics.cy) / self.intrinsics.fy, 1.0])
        along = self.pose[:3, :3] @ ray
        if along[2] >= 0.0:
            return math.inf
        place = self.pose[:2, 3] - along[:2] * (self.height_m / along[2])
        return float(np.hypot(*place))


@kernel
def _ground_pixels(depth: Array, camera: _CameraNumbers) -> Array:
    """Return which pixels of a depth image show ground.

    Parameters
    ----------
    depth : (rows, columns) float32
        Depths along the axis [m]; 0 is no measurement.

    Returns
    -------
    (rows, columns) bool
        Whether the pixel's point is on the ground and within range.
    """
    shown = np.zeros(depth.shape, np.bool_)
    pinhole, pose, limits = camera.pinhole, camera.pose, camera.limits
    squared = limits[RANGE] * limits[RANGE]
    for row in range(depth.shape[0]):
        down = (row - pinhole[CY]) / pinhole[FY]
        for column in range(depth.shape[1]):
            along = float(depth[row, column])
            if not along > 0.0:
                continue
            aside = (column - pinhole[CX]) / pinhole[FX]
            fall = -(pose[2, 0] * aside + pose[2, 1] * down + pose[2, 2])
            height = pose[2, 3] - along * fall
            if not (fall > 0.0 and limits[LOWEST] <= height <= limits[HIGHEST]):
                continue
            # The ray goes on by this share of what it falls until it meets the ground.
            ray = 1.0 + aside * aside + down * down
            shortfall = height / fall * math.sqrt(max(ray - fall * fall, 0.0))
            shown[row, column] = along * along * ray <= squared and shortfall <= limits[SHORTFALL]
    return shown


BEHIND_M = 0.15
"""Points farther behind a position than this are seen through it [m]."""

MIN_DEPTH_M = 0.05
"""Nearer points are not projected [m]."""

AROUND_M = 0.02
"""Around a box, too, everything has to be farther away [m]."""

MIN_PIXELS, COARSEST_M = 2.0, 0.03
"""Smaller boxes may lie between the pixels of an image, if these are farther apart [pixels, m]."""

_SHARES = np.array(list(itertools.product((0.0, 0.5, 1.0), repeat=3)))


def are_seen_through(
    boxes: NDArray[np.float64],
    depth: NDArray[np.float32],
    intrinsics: Intrinsics,
    pose: NDArray[np.float64],
    range_m: float,
) -> NDArray[np.bool_]:
    """Return which boxes an image shows to be gone.

    Parameters
    ----------
    boxes : (M, 2, 3) float64
        Low and high corners [m].
    depth : (rows, columns) float32
        The image [m]; 0 is no measurement, and shows nothing.
    pose : (4, 4) float64
        Pose of the camera's optical frame among the boxes.
    range_m : float
        Boxes farther away are left out [m].

    Returns
    -------
    (M,) bool
        Boxes that are wholly in the image, not lost in it, and seen through all over and around.
    """
    gone = np.zeros(len(boxes), np.bool_)
    into = inverse_of(pose)
    middles = _projected(moved_points(boxes.mean(axis=1), into), intrinsics)
    ahead = np.flatnonzero(_are_within(middles, depth.shape, range_m))
    if len(ahead) == 0:
        return gone
    low, high = boxes[ahead, None, 0] - AROUND_M, boxes[ahead, None, 1] + AROUND_M
    samples = moved_points((low + _SHARES * (high - low)).reshape(-1, 3), into)
    shown = _projected(samples, intrinsics).reshape(len(ahead), -1, 3)
    is_large = np.all(np.ptp(shown[..., :2], axis=1) >= MIN_PIXELS, axis=1)
    is_fine = shown[..., 2].max(axis=1) <= COARSEST_M * intrinsics.fx
    is_chosen = (is_large | is_fine) & np.all(_are_within(shown, depth.shape, range_m), axis=1)
    ahead, shown = ahead[is_chosen], shown[is_chosen]
    columns, rows = np.rint(shown[..., 0]).astype(np.int64), np.rint(shown[..., 1]).astype(np.int64)
    gone[ahead] = np.all(depth[rows, columns] > shown[..., 2] + BEHIND_M, axis=1)
    return gone


def _projected(points: NDArray[np.float64], intrinsics: Intrinsics) -> NDArray[np.float64]:
    """Return column and row [pixels] and depth [m] of points (N, 3) in the optical frame, (N, 3)."""
    along = np.where(points[:, 2] > MIN_DEPTH_M, points[:, 2], np.nan)
    columns = intrinsics.fx * points[:, 0] / along + intrinsics.cx
    rows = intrinsics.fy * points[:, 1] / along + intrinsics.cy
    return np.stack([columns, rows, along], axis=1)


def _are_within(shown: NDArray[np.float64], shape: tuple[int, ...], range_m: float) -> NDArray[np.bool_]:
    """Return which projected points (..., 3) lie in the image and are near enough, (...) bool."""
    limits = np.array([shape[1] - 1.0, shape[0] - 1.0, range_m])
    return np.asarray(np.all((shown >= 0.0) & (shown <= limits), axis=-1))


_SPARE_CELLS = 32


class SeenGround:
    """Cells of the ground that a camera has seen or its robot has driven over.

    Parameters
    ----------
    camera : GroundCamera
        The camera.
    radius : float
        Radius of the robot's body: below it the ground is known [m].
    cell_m : float
        Side of a cell [m].

    Attributes
    ----------
    cells : (rows, columns) bool
        Which cells are seen.
    low : (2,) int64
        Number of the first cell along x and y: it begins at ``low * cell_m``.
    """

    def __init__(self, camera: GroundCamera, radius: float, cell_m: float = 0.1) -> None:
        self.camera, self.cell_m = camera, cell_m
        self._radius, self._numbers = radius, camera.numbers
        self._reach = math.ceil(max(camera.range_m, radius) / cell_m) + 1
        self._poses = GrowingArray((3,), np.float64)
        self._images: list[NDArray[np.uint8]] = []
        self.cells, self.low = np.zeros((0, 0), np.bool_), np.zeros(2, np.int64)

    def __len__(self) -> int:
        """Return of how many images it is made."""
        return len(self._poses)

    def add(self, pose: NDArray[np.float64], depth: NDArray[np.float32]) -> None:
        """Take in an image (rows, columns) [m] that was taken at x, y, theta (3,) [m, rad]."""
        shown = _ground_pixels(depth, self._numbers)
        self._poses.append(pose)
        self._images.append(np.packbits(shown))
        self._draw(pose, shown)

    def move(self, poses: NDArray[np.float64]) -> None:
        """Draw the ground again, of the same images at other poses (N, 3) [m, rad]."""
        if poses.shape != self._poses.rows.shape:
            raise ValueError(f"poses have shape {poses.shape}; want {self._poses.rows.shape}, one per image")
        self._poses.rows[:] = poses
        self.cells, self.low = np.zeros((0, 0), np.bool_), np.zeros(2, np.int64)
        count = math.prod(self.camera.shape)
        for pose, image in zip(self._poses.rows, self._images, strict=True):
            shown = np.unpackbits(image, count=count).astype(np.bool_).reshape(self.camera.shape)
            self._draw(pose, shown)

    def _draw(self, pose: NDArray[np.float64], shown: NDArray[np.bool_]) -> None:
        middle = np.floor(pose[:2] / self.cell_m).astype(np.int64)
        self._grow(middle - self._reach, middle + self._reach + 1)
        _mark(self.cells, self.low, self.cell_m, self._numbers, pose, shown, self._radius)

    def _grow(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> None:
        """Make room for the cells from ``low`` to ``high`` (2,), by their numbers along x and y."""
        own_high = self.low + self.cells.shape[::-1]
        if self.cells.size and (low >= self.low).all() and (high <= own_high).all():
            return
        if self.cells.size:
            low, high = np.minimum(low, self.low), np.maximum(high, own_high)
        low, high = low - _SPARE_CELLS, high + _SPARE_CELLS
        self.cells, self.low = _placed(self.cells, self.low, low, high), low


class GroundCells(Protocol):
    """Seen cells, as `SeenGround` has them."""

    @property
    def cells(self) -> NDArray[np.bool_]:
        """Which cells are seen, (rows, columns)."""

    @property
    def low(self) -> NDArray[np.int64]:
        """Number of the first cell along x and y, (2,)."""


def joined_ground(parts: Sequence[GroundCells]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Return the cells that any of several has seen, and the number of the first one, as `SeenGround` has.

    All have cells of the same size and the same frame.
    """
    parts = [part for part in parts if part.cells.size]
    if not parts:
        return np.zeros((1, 1), np.bool_), np.zeros(2, np.int64)
    low = np.min([part.low for part in parts], axis=0)
    high = np.max([part.low + part.cells.shape[::-1] for part in parts], axis=0)
    cells = np.zeros((high - low)[::-1], np.bool_)
    for part in parts:
        column, row = part.low - low
        rows, columns = part.cells.shape
        cells[row : row + rows, column : column + columns] |= part.cells
    return cells, low


def _placed(
    cells: NDArray[np.bool_], at: NDArray[np.int64], low: NDArray[np.int64], high: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return cells within a larger grid from ``low`` to ``high``."""
    larger = np.zeros((high - low)[::-1], np.bool_)
    column, row = at - low
    larger[row : row + cells.shape[0], column : column + cells.shape[1]] = cells
    return larger


@kernel
def _mark(
    cells: Array, low: Array, cell: float, camera: _CameraNumbers, pose: Array, shown: Array, radius: float
) -> None:
    """Mark the cells whose centres are shown as ground, or lie below the body.

    Parameters
    ----------
    cells : (rows, columns) bool
        Result.
    low : (2,) int64
        Number of the first cell along x and y.
    cell, radius : float
        Side of a cell and radius of the body [m].
    pose : (3,) float64
        x, y, theta of the robot [m, rad].
    shown : (image rows, image columns) bool
        Which pixels show ground.
    """
    mount, pinhole = camera.pose, camera.pinhole
    reach = max(camera.limits[RANGE], radius)
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    first_row = max(int(math.floor((pose[1] - reach) / cell)) - low[1], 0)
    last_row = min(int(math.floor((pose[1] + reach) / cell)) - low[1], cells.shape[0] - 1)
    first_column = max(int(math.floor((pose[0] - reach) / cell)) - low[0], 0)
    last_column = min(int(math.floor((pose[0] + reach) / cell)) - low[0], cells.shape[1] - 1)
    for row in range(first_row, last_row + 1):
        gap_y = (low[1] + row + 0.5) * cell - pose[1]
        for column in range(first_column, last_column + 1):
            gap_x = (low[0] + column + 0.5) * cell - pose[0]
            if gap_x * gap_x + gap_y * gap_y <= radius * radius:
                cells[row, column] = True
                continue
            # From the robot's frame into the optical one.
            x = cosine * gap_x + sine * gap_y - mount[0, 3]
            y = cosine * gap_y - sine * gap_x - mount[1, 3]
            z = -mount[2, 3]
            along = mount[0, 2] * x + mount[1, 2] * y + mount[2, 2] * z
            if along <= 0.0:
                continue
            aside = (mount[0, 0] * x + mount[1, 0] * y + mount[2, 0] * z) / along
            down = (mount[0, 1] * x + mount[1, 1] * y + mount[2, 1] * z) / along
            image_column = math.floor(pinhole[FX] * aside + pinhole[CX] + 0.5)
            image_row = math.floor(pinhole[FY] * down + pinhole[CY] + 0.5)
            if 0 <= image_column < shown.shape[1] and 0 <= image_row < shown.shape[0]:
                cells[row, column] |= shown[int(image_row), int(image_column)]


SEEN, UNKNOWN, BLOCKED = -1, 0, 1
"""State of a cell; signs are those of log-odds, so that frontiers are found as in any grid."""


@dataclass(frozen=True, eq=False, slots=True)
class GroundMap:
    """The known ground.

    Attributes
    ----------
    levels : (rows, columns) int8
        ``SEEN``, ``UNKNOWN`` or ``BLOCKED``; row 0 has the lowest y.
    origin : (x, y)
        Lower left corner [m].
    cell_m : float
        Side of a cell [m].
    """

    levels: NDArray[np.int8]
    origin: tuple[float, float]
    cell_m: float

    @property
    def frame(self) -> NDArray[np.float64]:
        """The lower left corner and the side of a cell [m], shape (3,), for kernels."""
        return np.array([*self.origin, self.cell_m])

    @property
    def seen_m2(self) -> float:
        """Area of the ground that was seen [m2]."""
        return float(np.count_nonzero(self.levels == SEEN) * self.cell_m**2)

    def frontiers(self, least_m: float) -> Clusters:
        """Return where seen ground borders on unknown cells, in connected groups of at least a length [m]."""
        shape = (self.levels.shape[0], self.levels.shape[1])
        frontiers = FrontierMap(shape, self.cell_m)
        frontiers.update(self.levels)
        return frontiers.clusters(self.origin, max(round(least_m / self.cell_m), 1))

    def centres(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centres x, y of cells (N, 2) by row and column [m], (N, 2)."""
        return np.asarray((cells[:, ::-1] + 0.5) * self.cell_m + self.origin)

    def cells_of(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the cells (row, column) of points x, y (N, 2) [m], which may lie outside of the map."""
        return np.floor((points - self.origin) / self.cell_m).astype(np.int64)[:, ::-1]

    def are_unknown(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points x, y (N, 2) [m] lie on unknown ground, (N,) bool; those outside do."""
        cells = self.cells_of(points)
        is_inside = ((cells >= 0) & (cells < self.levels.shape)).all(axis=1)
        rows, columns = cells[is_inside].T
        found = np.ones(len(cells), np.bool_)
        found[is_inside] = self.levels[rows, columns] == UNKNOWN
        return found


def ground_map(
    cells: NDArray[np.bool_],
    origin: tuple[float, float],
    cell_m: float,
    boxes: NDArray[np.float64],
    body: SweptBody,
) -> GroundMap:
    """Return the map of seen ground and of obstacles on it.

    Parameters
    ----------
    cells : (rows, columns) bool
        Which cells were seen.
    origin : (x, y)
        Lower left corner of the first cell [m].
    cell_m : float
        Side of a cell [m].
    boxes : (M, 2, 3) float64
        Low and high corners of the obstacles [m]; boxes that a body passes below take up no cell.
    """
    levels = np.where(cells, SEEN, UNKNOWN).astype(np.int8)
    flat = np.ascontiguousarray(boxes.reshape(-1, 6))
    _block(levels, np.array([*origin, cell_m]), flat, body.numbers)
    return GroundMap(levels, origin, cell_m)


@kernel
def _block(levels: Array, frame: Array, boxes: Array, body: Array) -> None:
    """Mark the cells over which boxes (M, 6) block a body (3,)."""
    rows, columns, cell = levels.shape[0], levels.shape[1], frame[2]
    for box in boxes:
        if box[2] >= body[2] or box[5] <= body[1]:
            continue
        first_row, last_row = (box[1] - frame[1]) // cell, (box[4] - frame[1]) // cell
        first_column, last_column = (box[0] - frame[0]) // cell, (box[3] - frame[0]) // cell
        for row in range(int(max(first_row, 0.0)), int(min(last_row, rows - 1.0)) + 1):
            for column in range(int(max(first_column, 0.0)), int(min(last_column, columns - 1.0)) + 1):
                levels[row, column] = BLOCKED
