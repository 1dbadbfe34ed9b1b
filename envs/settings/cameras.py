"""Depth cameras, with their mounts and the noise of their depths.

References
----------
C. V. Nguyen, S. Izadi and D. Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction and
tracking", 3DIMPVT 2012: noise along the axis. K. Khoshelham and S. O. Elberink, "Accuracy and resolution of
Kinect depth data", Sensors 12 (2012): disparities in eighths of a pixel.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import above, check_settings, within
from lidarium.mapping.point_clouds.cameras import Intrinsics
from lidarium.registry import Registry

MOST_PIXELS = 2048
"""Longest side of a depth image [pixels]."""

MAX_DEVIATION_M = 0.01
"""Standard deviation of depths up to which boxes of maps are made of them [m]: half a voxel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepthCamera:
    """A depth camera on a robot: a pinhole that measures the depth along its axis.

    Attributes
    ----------
    columns : int
        Width of an image [pixels].
    rows : int
        Height of an image [pixels].
    field_of_view : float
        Horizontal angle that an image covers [rad]; pixels are square.
    depth_min : float
        Minimum depth that is measured [m].
    depth_max : float
        Maximum depth that is measured [m].
    height : float
        Height of the optical centre above the floor [m].
    forward : float
        Position of the optical centre in front of the centre of the robot [m].
    left : float
        Position of the optical centre to the left of the centre of the robot [m].
    pitch : float
        Angle by which the axis points below the robot's heading [rad].
    pan : float
        Angle by which the axis points to the left of the robot's heading [rad].
    rate_hz : float
        Images per second; at most one per time step is taken [1/s].
    noise_floor : float
        Standard deviation of the noise at ``depth_min`` [m].
    noise_share : float
        Growth of the standard deviation with the square of the depth beyond ``depth_min`` [1/m].
    disparity_step : float
        Step of the inverse depth that is measured [1/m]; 0 for exact depths.
    """

    columns: Annotated[int, within(1, MOST_PIXELS)] = 320
    rows: Annotated[int, within(1, MOST_PIXELS)] = 240
    field_of_view: Annotated[float, within(0.01, 3.0)] = math.radians(58.0)
    depth_min: Annotated[float, within(0.0, 100.0)] = 0.4
    depth_max: Annotated[float, above(0.0, 200.0)] = 4.0
    height: Annotated[float, above(0.0, 100.0)] = 0.5
    forward: Annotated[float, within(-10.0, 10.0)] = 0.0
    left: Annotated[float, within(-10.0, 10.0)] = 0.0
    pitch: Annotated[float, within(-math.pi / 2.0, math.pi / 2.0)] = 0.0
    pan: Annotated[float, within(-math.pi, math.pi)] = 0.0
    rate_hz: Annotated[float, above(0.0, 1e4)] = 30.0
    noise_floor: Annotated[float, within(0.0, 10.0)] = 0.0
    noise_share: Annotated[float, within(0.0, 10.0)] = 0.0
    disparity_step: Annotated[float, within(0.0, 10.0)] = 0.0

    def __post_init__(self) -> None:
        check_settings(self, "the camera")
        if not self.depth_min < self.depth_max:
            raise ValueError(
                f"depth_min of the camera is {self.depth_min} m; want less than depth_max, {self.depth_max} m"
            )

    @property
    def intrinsics(self) -> Intrinsics:
        """Focal length and principal point [pixels]; the centre of the first pixel is (0, 0)."""
        focal = 0.5 * self.columns / math.tan(0.5 * self.field_of_view)
        return Intrinsics(focal, focal, 0.5 * (self.columns - 1), 0.5 * (self.rows - 1))

    @property
    def mount(self) -> NDArray[np.float64]:
        """Pose of the camera on the robot: x, y, z [m], pitch, pan [rad], shape (5,)."""
        return np.array([self.forward, self.left, self.height, self.pitch, self.pan])

    @property
    def calibration(self) -> dict[str, Any]:
        """The camera's parameters for infos: its ``intrinsics`` by name, and its ``mount``."""
        pinhole = self.intrinsics
        intrinsics = {"fx": pinhole.fx, "fy": pinhole.fy, "cx": pinhole.cx, "cy": pinhole.cy}
        return {"intrinsics": intrinsics, "mount": self.mount}

    def calibrations(self, robots: int) -> dict[str, Any]:
        """Return the calibration of the cameras of that many robots, in arrays that cannot be written to."""
        of_one = self.calibration
        intrinsics = {name: np.broadcast_to(value, robots) for name, value in of_one["intrinsics"].items()}
        return {"intrinsics": intrinsics, "mount": np.broadcast_to(of_one["mount"], (robots, len(of_one["mount"])))}

    @property
    def is_noisy(self) -> bool:
        """Whether depths carry noise or are rounded."""
        return self.noise_floor > 0.0 or self.noise_share > 0.0 or self.disparity_step > 0.0

    @property
    def precise_m(self) -> float:
        """Depth up to which noise and rounding deviate by at most ``MAX_DEVIATION_M`` [m].

        Boxes hold all of their points, so that noise widens them; what is farther will be seen from nearer before
        a robot is there. It is ``depth_max`` if all depths are precise, or none.
        """
        depths = np.linspace(self.depth_min, self.depth_max, 1000)
        noise = self.noise_floor + self.noise_share * (depths - self.depth_min) ** 2
        rounding = depths**2 * self.disparity_step / math.sqrt(12.0)
        precise = depths[np.hypot(noise, rounding) <= MAX_DEVIATION_M]
        return float(precise[-1]) if len(precise) else self.depth_max

    def period_steps(self, time_step: float) -> int:
        """Return after how many time steps the next image is taken, at least 1."""
        return max(round(1.0 / (self.rate_hz * time_step)), 1)


CAMERAS: Registry[DepthCamera] = Registry("camera")
"""Depth cameras by name."""

CAMERAS.register("xtion", DepthCamera(), "Asus Xtion: 320 x 240, 58 degrees, 0.4 to 4 m, exact depths")
CAMERAS.register(
    "xtion_tilted",
    DepthCamera(pitch=math.radians(20.0)),
    "the Xtion looking 20 degrees down, at the ground",
)
CAMERAS.register("xtion_vga", DepthCamera(columns=640, rows=480), "the Xtion at 640 x 480")
CAMERAS.register(
    "xtion_noisy",
    DepthCamera(noise_floor=0.0012, noise_share=0.0019, disparity_step=1.0 / 345.0),
    "the Xtion with its noise, and disparities in eighths of a pixel",
)
CAMERAS.register(
    "depth_64x48",
    DepthCamera(columns=64, rows=48),
    "64 x 48, 58 degrees, for learning",
)
