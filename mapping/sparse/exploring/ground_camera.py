"""A depth camera above the ground: which pixels show ground, and how far away."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.kernels.compilation import Array, kernel
from lidarium.mapping.point_clouds.intrinsics import Intrinsics

FX, FY, CX, CY = range(4)
"""Places in the numbers of a pinhole."""

RANGE, LOWEST, HIGHEST, SHORTFALL = range(4)
"""Places in the limits of a camera."""


class CameraNumbers(NamedTuple):
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
        foot of a wall hides what is behind [m].

    Raises
    ------
    ValueError
        Where the camera sees no ground within its range.
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
    def numbers(self) -> CameraNumbers:
        """The camera as kernels take it."""
        pinhole = self.intrinsics
        return CameraNumbers(
            np.array([pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy]),
            np.ascontiguousarray(self.pose[:3], np.float64),
            np.array([self.range_m, self.lowest_m, self.highest_m, self.shortfall_m]),
        )

    @property
    def nearest_m(self) -> float:
        """Distance from the robot at which the lowest row sees the ground [m]; inf where it does not."""
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
def ground_pixels(depth: Array, camera: CameraNumbers) -> Array:
    """Return which pixels of a depth image show ground.

    Parameters
    ----------
    depth : (rows, columns) float32
        Depths along the axis [m]; 0 is no measurement.
    camera : CameraNumbers
        The camera.

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
