"""The motion between sensings, by calibrated odometry or by the last motion.

Wheels differ in size and spacing from their assumed values. Matches show the robot's true motion if walls
show it; elsewhere, as along a bare corridor, calibrated odometry continues without them. The errors are the
scales of distance and turn, and a turn for each metre; their estimate is that of recursive least squares (a
Kalman filter without motion), and old matches fade.

References
----------
The parameters are those of Censi, Franchi, Marchionni, Oriolo, Simultaneous calibration of odometry and
sensor parameters for mobile robots (IEEE Transactions on Robotics 2013), to first order.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.rigid import relative
from lidarium.mapping.geometry.small_matrices import inverse, product, pseudo_inverse
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.settings import OdometryUncertainty, SlamSettings


class OdometryCalibration:
    """Systematic errors of odometry, and how well they are known.

    Parameters
    ----------
    settings : OdometryUncertainty
        Prior knowledge.

    Attributes
    ----------
    errors : (3,) float64
        Share by which a distance is longer than measured, share by which a turn is larger, and turn for each
        metre [m/m, rad/rad, rad/m].
    covariance : (3, 3) float64
        Of the errors.
    """

    def __init__(self, settings: OdometryUncertainty) -> None:
        self._settings = settings
        self.errors = np.zeros(3)
        self.covariance = self._at_first()

    def _at_first(self) -> NDArray[np.float64]:
        settings = self._settings
        return np.diag([settings.distance_share**2, settings.turn_share**2, settings.turn_per_metre**2])

    def corrected(self, motion: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a small odometry motion without its systematic errors [m, rad].

        The motion is x, y, theta (3,).
        """
        along, turn = self.errors[0], self.errors[1] * motion[2] + self.errors[2] * motion[0]
        half = 0.5 * turn
        x, y = (1.0 + along) * motion[0], (1.0 + along) * motion[1]
        cosine, sine = math.cos(half), math.sin(half)
        return np.array([cosine * x - sine * y, sine * x + cosine * y, motion[2] + turn])

    def uncertainty(self, distance: float, turn: float) -> NDArray[np.float64]:
        """Return the covariance (3, 3) of a corrected motion, at its end [m, rad].

        The motion consists of a distance (negative backwards) and a turn.
        """
        lever = _lever(distance, turn)
        return self._settings.noise(distance, turn) + product(lever, self.covariance, lever.T)

    def learn(
        self,
        distance: float,
        turn: float,
        difference: NDArray[np.float64],
        information: NDArray[np.float64],
        prior: NDArray[np.float64],
    ) -> None:
        """Learn from a match.

        Parameters
        ----------
        distance, turn : float
            Motion by odometry since the last match [m, rad].
        difference : (3,) float64
            Pose of the match in the frame of the expected pose: x, y, theta [m, rad].
        information : (3, 3) float64
            Information of the points of the scan alone, in the same frame [1/m^2, 1/(m rad), 1/rad^2].
        prior : (3, 3) float64
            Prior information, which is part of the match too.
        """
        settings = self._settings
        lever = _lever(distance, turn)
        # The last match was no better than this one, and what is left of a motion is its noise.
        spread = settings.noise(distance, turn) + pseudo_inverse(information + prior)
        share = inverse(np.eye(3) + product(information, spread))
        weighted = product(share, information)
        seen = product(share, information + prior, difference)
        faded = 1.0 - (1.0 - settings.fading) ** (abs(distance) + abs(turn))
        grown = (1.0 - faded) * self.covariance + faded * self._at_first()
        before = inverse(grown)
        after = before + product(lever.T, weighted, lever)
        self.covariance = inverse(0.5 * (after + after.T))
        self.errors = self.errors + product(self.covariance, lever.T, seen)
        bound = settings.most_deviations * np.sqrt(np.diag(self._at_first()))
        self.errors = np.clip(self.errors, -bound, bound)


def _lever(distance: float, turn: float) -> NDArray[np.float64]:
    """Return the effect of the errors at the end of a motion, (3, 3).

    In x, y [m] and heading [rad].
    """
    half = 0.5 * distance
    return np.array([[distance, 0.0, 0.0], [0.0, half * turn, half * distance], [0.0, turn, distance]])


class OdometryMotion:
    """Measurements of odometry between matches, and their covariance.

    Attributes
    ----------
    velocity : (3,) float64
        The last motion between sensings, taken if odometry does not measure one [m, m, rad].
    is_measured : bool
        Whether odometry has measured all motion since the last match.
    """

    def __init__(self, settings: SlamSettings) -> None:
        self._uses_odometry = settings.uses_odometry
        self._calibration = OdometryCalibration(settings.odometry)
        self._last: Sensing | None = None
        self.velocity = np.zeros(3)
        self.is_measured = settings.uses_odometry
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
        ends = np.stack([self._last.odometry, sensing.odometry])
        if not self._uses_odometry or not np.isfinite(ends).all():
            self.is_measured = False
            return self.velocity
        motion = relative(ends[0], ends[1])
        self._measured += motion[[0, 2]]
        self.velocity = self._calibration.corrected(motion)
        return self.velocity

    @property
    def has_moved(self) -> bool:
        """Whether odometry has measured any motion since the last match."""
        return bool(self._measured.any())

    def growth(self) -> NDArray[np.float64]:
        """Return the covariance (3, 3) of the motion by odometry since the last match.

        It is in the robot's present frame.
        """
        return self._calibration.uncertainty(float(self._measured[0]), float(self._measured[1]))

    def learn(self, error: NDArray[np.float64], measured: NDArray[np.float64], prior: NDArray[np.float64]) -> None:
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
        self.is_measured = self._uses_odometry
