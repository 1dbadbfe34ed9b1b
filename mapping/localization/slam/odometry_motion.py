"""The motion between sensings, by calibrated odometry or by the last motion."""

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import relative
from lidarium.mapping.localization.dead_reckoning.localizer import Sensing
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.slam.calibration import OdometryCalibration


class OdometryMotion:
    """What odometry measures between matches, and how well.

    Parameters
    ----------
    settings : SlamSettings
        How odometry is used and calibrated.

    Attributes
    ----------
    velocity : (3,) float64
        The last motion between matches, taken where odometry is not used [m, m, rad].
    """

    def __init__(self, settings: SlamSettings) -> None:
        self._uses_odometry = settings.uses_odometry
        self._calibration = OdometryCalibration(settings.odometry)
        self._last: Sensing | None = None
        self.velocity = np.zeros(3)
        # What odometry has measured since the last match: distance, negative backwards, and turn [m, rad].
        self._measured = np.zeros(2)

    def take(self, sensing: Sensing) -> tuple[NDArray[np.float64], float]:
        """Take in a sensing, and return the motion (3,) and the time since the one before [m, rad, s]."""
        motion = self._motion(sensing)
        period = sensing.time_s - self._last.time_s if self._last is not None else 0.0
        self._last = sensing
        return motion, period

    def _motion(self, sensing: Sensing) -> NDArray[np.float64]:
        if self._last is None:
            return np.zeros(3)
        if not self._uses_odometry:
            return self.velocity
        ends = np.stack([self._last.odometry, sensing.odometry])
        if not np.isfinite(ends).all():
            return np.zeros(3)
        motion = relative(ends[0], ends[1])
        self._measured += motion[[0, 2]]
        return self._calibration.corrected(motion)

    @property
    def has_moved(self) -> bool:
        """Whether odometry has measured any motion since the last match."""
        return bool(self._measured.any())

    def growth(self) -> NDArray[np.float64]:
        """Return the covariance (3, 3) of the motion by odometry since the last match.

        It is in the robot's present frame.
        """
        return self._calibration.uncertainty(float(self._measured[0]), float(self._measured[1]))

    def learn(
        self, error: NDArray[np.float64], measured: NDArray[np.float64], prior: NDArray[np.float64]
    ) -> None:
        """Learn from a match how odometry errs.

        Parameters
        ----------
        error : (3,) float64
            The matched pose as seen from the one by odometry [m, rad].
        measured, prior : (3, 3) float64
            Information of the match by the scan and by odometry, in the robot's frame.
        """
        self._calibration.learn(float(self._measured[0]), float(self._measured[1]), error, measured, prior)

    def begin_interval(self) -> None:
        """Measure from here on: the pose is known otherwise."""
        self._measured[:] = 0.0
