"""The plane of the floor, against which heights are measured."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class FloorPlane:
    """A plane by its upward normal.

    Attributes
    ----------
    x, y, z : float
        Unit normal, to the side on which things stand.
    offset : float
        Height of the origin above the plane [m].
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        numbers = (self.x, self.y, self.z, self.offset)
        length = math.hypot(self.x, self.y, self.z)
        if not (all(map(math.isfinite, numbers)) and abs(length - 1.0) < 1e-6):
            raise ValueError(
                f"the floor is {numbers}; want a unit normal with the height of the origin above it"
            )

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit normal, shape (3,)."""
        return np.array([self.x, self.y, self.z])

    @property
    def tilt(self) -> float:
        """Angle between the normal and the z axis [rad]."""
        return math.atan2(math.hypot(self.x, self.y), self.z)

    def heights(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the heights of points (..., 3) above the plane [m], shape (...)."""
        return np.asarray(points @ self.normal + self.offset)

    def levelling(self) -> NDArray[np.float64]:
        """Return the rigid motion (4, 4) by the least turn that makes the plane z = 0."""
        axis = np.array([self.y, -self.x, 0.0])
        cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
        motion = np.eye(4)
        if self.z > -1.0 + 1e-9:
            motion[:3, :3] += cross + cross @ cross / (1.0 + self.z)
        else:
            motion[1, 1] = motion[2, 2] = -1.0
        motion[2, 3] = self.offset
        return motion
