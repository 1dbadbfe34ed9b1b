"""Settings of wheel odometry: bias, noise, whole ticks."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import check_settings, share, within
from lidarium.registry import Registry


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySettings:
    """Accuracy of the wheels' path measurement.

    Attributes
    ----------
    distance_bias : float, default 0.0
        Share by which distances are measured too long or too short throughout an episode [1].
    turn_bias : float, default 0.0
        Share by which turns are measured too large or too small throughout an episode [1].
    drift : float, default 0.0
        False turn measured per metre, to the left or to the right throughout an episode [rad/m].
    turn_noise_of_turn : float, default 0.0
        Growth of a turn's standard deviation with the square root of the turn [rad^(1/2)].
    turn_noise_of_distance : float, default 0.0
        Growth of a turn's standard deviation with the square root of the distance [rad/m^(1/2)].
    distance_noise_of_distance : float, default 0.0
        Growth of a distance's standard deviation with the square root of the distance [m^(1/2)].
    distance_noise_of_turn : float, default 0.0
        Growth of a distance's standard deviation with the square root of the turn [m/rad^(1/2)].
    counts_ticks : bool, default False
        Whether encoders count whole ticks; the robot defines how many make a metre.
    speed_noise : float, default 0.0
        Standard deviation of the speed with which the drive executes a command, as a share of it [1].
    turn_rate_noise : float, default 0.0
        Standard deviation of the turn rate with which the drive executes a command, as a share of it [1].
    """

    distance_bias: Annotated[float, share(has_maximum=False)] = 0.0
    turn_bias: Annotated[float, share(has_maximum=False)] = 0.0
    drift: Annotated[float, within(0.0, 10.0)] = 0.0
    turn_noise_of_turn: Annotated[float, within(0.0, 10.0)] = 0.0
    turn_noise_of_distance: Annotated[float, within(0.0, 10.0)] = 0.0
    distance_noise_of_distance: Annotated[float, within(0.0, 10.0)] = 0.0
    distance_noise_of_turn: Annotated[float, within(0.0, 10.0)] = 0.0
    counts_ticks: bool = False
    speed_noise: Annotated[float, within(0.0, 10.0)] = 0.0
    turn_rate_noise: Annotated[float, within(0.0, 10.0)] = 0.0

    def __post_init__(self) -> None:
        check_settings(self, "the odometry")

    @property
    def is_ideal(self) -> bool:
        """Whether wheels measure exactly and drives follow their commands exactly."""
        return self == OdometrySettings()

    @property
    def disturbs_drives(self) -> bool:
        """Whether drives deviate from their commands."""
        return self.speed_noise > 0.0 or self.turn_rate_noise > 0.0

    @property
    def numbers(self) -> NDArray[np.float64]:
        """Numbers of the odometry for the kernels, shape (7,).

        Four are of encoder noise, one selects ticks, two are of the drive's noise.
        """
        return np.array(
            [
                self.turn_noise_of_turn,
                self.turn_noise_of_distance,
                self.distance_noise_of_distance,
                self.distance_noise_of_turn,
                float(self.counts_ticks),
                self.speed_noise,
                self.turn_rate_noise,
            ]
        )


ODOMETRY: Registry[OdometrySettings] = Registry("odometry")
"""Odometry by name."""

ODOMETRY.register("ideal", OdometrySettings(), "wheels measure exactly, drives follow commands exactly")
ODOMETRY.register(
    "good",
    OdometrySettings(
        distance_bias=0.01,
        turn_bias=0.01,
        drift=0.002,
        turn_noise_of_turn=0.01,
        turn_noise_of_distance=0.005,
        distance_noise_of_distance=0.01,
        distance_noise_of_turn=0.002,
        counts_ticks=True,
        speed_noise=0.02,
        turn_rate_noise=0.02,
    ),
    "1 % bias, whole ticks, little noise",
)
ODOMETRY.register(
    "typical",
    OdometrySettings(
        distance_bias=0.05,
        turn_bias=0.05,
        drift=0.01,
        turn_noise_of_turn=0.03,
        turn_noise_of_distance=0.02,
        distance_noise_of_distance=0.02,
        distance_noise_of_turn=0.005,
        counts_ticks=True,
        speed_noise=0.03,
        turn_rate_noise=0.03,
    ),
    "5 % bias, whole ticks, some noise",
)
ODOMETRY.register(
    "poor",
    OdometrySettings(
        distance_bias=0.1,
        turn_bias=0.1,
        drift=0.03,
        turn_noise_of_turn=0.1,
        turn_noise_of_distance=0.05,
        distance_noise_of_distance=0.05,
        distance_noise_of_turn=0.01,
        counts_ticks=True,
        speed_noise=0.05,
        turn_rate_noise=0.05,
    ),
    "10 % bias, whole ticks, much noise",
)
