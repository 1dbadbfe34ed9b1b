"""The interface of localizers, which turn odometry and scans into a believed pose.

A localizer works on arrays alone, so the same one runs inside a simulated robot and on recorded data. Its map
frame is the frame of the pose that it is reset to.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Sensing:
    """Readings of a robot at one time.

    Attributes
    ----------
    time_s : float
        When the odometry was read and the last beam of the scan was taken [s].
    odometry : (3,) float64
        x, y, theta by dead reckoning since its own arbitrary beginning [m, rad]; nan if unknown.
    ranges : (beams,) float32
        The scan [m]; inf for no return, nan for an invalid beam.
    """

    time_s: float
    odometry: NDArray[np.float64]
    ranges: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class KeyScans:
    """Scans at their presently estimated poses, from which a map is rendered.

    Attributes
    ----------
    poses : (scans, 3) float64
        x, y, theta of the robot [m, rad].
    ranges : (scans, beams) float32
        Ranges as seen from these poses, motion within the scan undone [m]; inf for no return, nan for an
        invalid beam.
    times_s : (scans,) float64
        When each was taken, as ``Sensing`` said, in order [s].
    """

    poses: NDArray[np.float64]
    ranges: NDArray[np.float32]
    times_s: NDArray[np.float64]


class Localizer(Protocol):
    """Estimates the pose of a robot from its sensors."""

    def reset(self, pose: NDArray[np.float64], seed: int) -> None:
        """Begin again at x, y, theta (3,) [m, rad]; whatever is drawn comes from ``seed``."""
        ...

    def localize(self, sensing: Sensing) -> NDArray[np.float64]:
        """Take in sensor readings, later than all before.

        Return x, y, theta of the robot, shape (3,) [m, rad].
        """
        ...

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the last pose, shape (3, 3) [m^2, m rad, rad^2].

        Zero if the localizer claims to be certain.
        """
        ...

    def take_correction(self) -> KeyScans | None:
        """Return the scans for rendering the whole map again; else None.

        Once after each correction of past poses.
        """
        ...
