"""The ground that a robot's camera has seen, in cells.

A cell is seen where the pixel that shows its centre shows ground. So nothing is missed between the pixels of
a coarse image, and nothing is seen through what stands in between. Images are kept as a bit a pixel: where
poses are corrected, the ground is drawn again.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.grids.growing_array import GrowingArray
from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.sparse.exploring.ground_camera import (
    CX,
    CY,
    FX,
    FY,
    RANGE,
    CameraNumbers,
    GroundCamera,
    ground_pixels,
)

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
        shown = ground_pixels(depth, self._numbers)
        self._poses.append(pose)
        self._images.append(np.packbits(shown))
        self._draw(pose, shown)

    def move(self, poses: NDArray[np.float64]) -> None:
        """Draw the ground again, of the same images at other poses (N, 3) [m, rad].

        Raises
        ------
        ValueError
            Where these are not as many as there are images.
        """
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


def joined_ground(parts: list[SeenGround]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
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
    cells: Array, low: Array, cell: float, camera: CameraNumbers, pose: Array, shown: Array, radius: float
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
    camera : CameraNumbers
        The camera.
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
