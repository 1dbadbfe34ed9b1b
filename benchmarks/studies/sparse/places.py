"""Places of the study of sparse maps, and their survey."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lidarium.benchmarks.studies.shared.study import Task
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.faces import faces_of
from lidarium.envs.floors.floor import Floor
from lidarium.envs.settings.cameras import CAMERAS, DepthCamera
from lidarium.envs.settings.robots import ROBOTS
from lidarium.envs.simulation.depth.frames import image_of
from lidarium.envs.simulation.depth.point_cloud import camera_pose
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.point_clouds.cameras import map_from_base, points_of_depth
from lidarium.mapping.sparse.planning import points_along
from lidarium.mapping.sparse.swept_body import SweptBody

PLACES = ("robotics_laboratory", "signal_laboratory", "home_arena", "apartment")
"""Two laboratories, an arena and a flat, as in the thesis, section 5.2."""

BODY = SweptBody(radius=0.30, height=1.2)
REQUESTS = 1000
CLEAR_M = 0.05
"""By how much a start and a goal are farther from what stands there than the robot's radius [m]."""

CELL_M = 0.01
"""Side of a cell of the raster that decides whether a path collides [m]."""

STEP_M = 0.005
"""Distance of the points of a path that are looked up [m]."""


@dataclass(frozen=True, eq=False)
class Place:
    """A furnished floor as it is, for a body.

    `name`: name of the floor; `floor`: the floor; `origin` (2,) float64: lower left corner of the raster [m]; `gaps`
    (rows, columns) float32: distance of each cell's centre from the nearest solid one at the body's heights [m];
    `reached` (rows, columns) bool: cells to which the body can be driven from the first start.
    """

    name: str
    floor: Floor
    origin: NDArray[np.float64]
    gaps: NDArray[np.float32]
    reached: NDArray[np.bool_]

    def gaps_at(self, points: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the gaps at points (N, 2 or 3) [m]."""
        columns, rows = np.floor((points[:, :2] - self.origin) / CELL_M).astype(np.int64).T
        return np.asarray(self.gaps[rows, columns])

    def collides(self, path: NDArray[np.float64]) -> bool:
        """Whether the body is less than its radius, less a cell, from a solid anywhere on a path (P, 3)."""
        return bool(self.gaps_at(points_along(path, STEP_M)).min() < BODY.radius - CELL_M)

    def drawn_points(self, clearance_m: float, count: int, seed: int) -> NDArray[np.float64]:
        """Draw points (count, 2) that the body can reach, so far from solids [m]."""
        rows, columns = np.nonzero(self.reached & (self.gaps > clearance_m))
        drawn = np.random.default_rng(seed).integers(0, len(rows), count)
        return self.origin + (np.stack([columns[drawn], rows[drawn]], axis=1) + 0.5) * CELL_M


def load_place(name: str) -> Place:
    """Load a place."""
    return place_of(name, load_floor(name))


def place_of(name: str, floor: Floor) -> Place:
    """Return a floor as a place."""
    raster = floor.raster(CELL_M, BODY.clearance, BODY.height)
    gaps = ndimage.distance_transform_edt(raster.solid == 0) * CELL_M
    labels, _ = ndimage.label(gaps > BODY.radius)
    origin = np.array(raster.origin)
    column, row = np.floor((floor.starts[0, :2] - origin) / CELL_M).astype(np.int64)
    return Place(name, floor, origin, gaps.astype(np.float32), np.asarray(labels == labels[row, column]))


def requests_of(place: Place) -> NDArray[np.float64]:
    """Return starts and goals, (REQUESTS, 2, 2) [m]."""
    return place.drawn_points(BODY.radius + CLEAR_M, 2 * REQUESTS, seed=0).reshape(-1, 2, 2)


@dataclass(frozen=True, slots=True)
class PlaceTask(Task):
    """One of the places, and the frames of a turn there."""

    name: str
    turns: int


def place_tasks(every: int) -> list[PlaceTask]:
    """Return every N-th place. Of a part, turns have half the frames: these see all round as well."""
    return [PlaceTask(name, TURNS if every == 1 else TURNS // 2) for name in PLACES[::every]]


SPACING_M = 0.6
"""Between the points at which the robot turns [m]."""

TURNS = 8
"""Frames of a turn."""

ROBOT = "service"
CAMERA = replace(CAMERAS["xtion"], height=1.0, pitch=0.45)
"""The camera, where service robots have theirs: 1 m above the floor, and looking down."""


@dataclass(frozen=True, eq=False)
class Frame:
    """What the camera has seen.

    `points` (N, 3) float64: points in the camera's optical frame [m]; `pose` (4, 4) float64: pose of the optical frame
    in the map; `base` (3,) float64: pose of the robot [m, rad].
    """

    points: NDArray[np.float64]
    pose: NDArray[np.float64]
    base: NDArray[np.float64]

    @property
    def in_map(self) -> NDArray[np.float64]:
        """The points in the map, (N, 3) [m]."""
        return np.asarray(self.points @ self.pose[:3, :3].T + self.pose[:3, 3])


def stops_of(place: Place) -> NDArray[np.float64]:
    """Return where the robot turns, (S, 2), each next to the one before [m]."""
    step = round(SPACING_M / CELL_M)
    is_open = place.reached & (place.gaps > BODY.radius)
    cells = [
        _first_open(is_open[row : row + step, column : column + step], row, column)
        for row in range(0, is_open.shape[0], step)
        for column in range(0, is_open.shape[1], step)
    ]
    left = [np.array(cell) for cell in cells if cell is not None]
    tour = [left.pop(0)]
    while left:
        gaps = [float(np.hypot(*(cell - tour[-1]))) for cell in left]
        tour.append(left.pop(int(np.argmin(gaps))))
    return np.asarray(place.origin + (np.array(tour)[:, ::-1] + 0.5) * CELL_M)


def _first_open(part: NDArray[np.bool_], row: int, column: int) -> tuple[int, int] | None:
    """Return the open cell of a square that is nearest to its middle."""
    open_cells = np.argwhere(part)
    if len(open_cells) == 0:
        return None
    nearest = open_cells[np.abs(open_cells - np.array(part.shape) / 2.0).sum(axis=1).argmin()]
    return row + int(nearest[0]), column + int(nearest[1])


def frames_of(place: Place, turns: int = TURNS, camera: DepthCamera = CAMERA, seed: int = 0) -> Iterator[Frame]:
    """Yield the frames of a survey, with the camera's noise; a turn has a number of them."""
    faces, numbers = faces_of(place.floor), ROBOTS[ROBOT].numbers[None]
    mount, generator = camera_pose(camera), np.random.default_rng(seed)
    for stop in stops_of(place):
        for turn in range(turns):
            base = np.array([*stop, turn * math.tau / turns])
            depth = image_of(faces, base[None], np.zeros((1, 3)), numbers, 0, camera)
            points = points_of_depth(_disturbed(depth, camera, generator), camera.intrinsics)
            yield Frame(points.astype(np.float64), map_from_base(Transform(*base)) @ mount, base)


def _disturbed(depth: NDArray[np.float32], camera: DepthCamera, generator: np.random.Generator) -> NDArray[np.float32]:
    """Add a camera's noise to depths, and round their inverses to its steps."""
    if not camera.is_noisy:
        return depth
    deviation = camera.noise_floor + camera.noise_share * (depth - camera.depth_min) ** 2
    noisy = np.maximum(depth + deviation * generator.standard_normal(depth.shape), 1e-3)
    if camera.disparity_step > 0.0:
        noisy = 1.0 / (np.maximum(np.round(1.0 / (noisy * camera.disparity_step)), 1.0) * camera.disparity_step)
    within = np.clip(noisy, camera.depth_min, camera.depth_max)
    return np.where(depth > 0.0, within, 0.0).astype(np.float32)
