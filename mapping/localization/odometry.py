"""Dead reckoning: the pose is the start moved as the wheels measure."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.geometry.small_matrices import product
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.localizer import KeyScans, Sensing
from lidarium.mapping.localization.settings import OdometryUncertainty


class Odometry:
    """A localizer that believes its odometry.

    Parameters
    ----------
    settings : OdometryUncertainty or None
        By how much odometry may err.
    """

    Settings = OdometryUncertainty

    def __init__(self, settings: OdometryUncertainty | None = None, geometry: ScanGeometry | None = None) -> None:
        self._settings = settings or OdometryUncertainty()
        self.reset(np.zeros(3), 0)

    def reset(self, pose: NDArray[np.float64], seed: int) -> None:
        """Begin again at x, y, theta (3,) [m, rad]; nothing is drawn."""
        self._pose = np.array(pose, np.float64)
        self._covariance = np.zeros((3, 3))
        self._odometry: NDArray[np.float64] | None = None

    def localize(self, sensing: Sensing) -> NDArray[np.float64]:
        """Return the pose (3,) after the motion since the last time.

        The first time it is that of the start.
        """
        odometry = np.array(sensing.odometry, np.float64)
        if self._odometry is not None and np.isfinite(odometry).all():
            motion = relative(self._odometry, odometry)
            distance, turn = float(np.hypot(motion[0], motion[1])), float(motion[2])
            growth = self._settings.covariance(distance, turn) if motion.any() else np.zeros((3, 3))
            self._covariance = compounded(self._pose, self._covariance, motion, growth)
            self._pose = composed(self._pose, motion)
        if np.isfinite(odometry).all():
            self._odometry = odometry
        return self._pose.copy()

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the last pose, shape (3, 3) [m^2, m rad, rad^2]."""
        return self._covariance.copy()

    def take_correction(self) -> KeyScans | None:
        """Return None: the past is never corrected."""
        return None


def compounded(
    pose: NDArray[np.float64],
    covariance: NDArray[np.float64],
    motion: NDArray[np.float64],
    growth: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the covariance (3, 3) of ``composed(pose, motion)``.

    Parameters
    ----------
    pose, covariance : (3,) and (3, 3) float64
        Pose at the start of the motion, and its covariance.
    motion, growth : (3,) and (3, 3) float64
        The motion in the frame of the pose, and how well it is known in that frame.
    """
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    turned = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    lever = np.eye(3)
    lever[0, 2] = -(sine * motion[0] + cosine * motion[1])
    lever[1, 2] = cosine * motion[0] - sine * motion[1]
    return product(lever, covariance, lever.T) + product(turned, growth, turned.T)
