"""What is known of dead reckoning: by how much it may err."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from lidarium.mapping.geometry.bounds import FromZero, Positive, check_settings, share


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryUncertainty:
    """By how much dead reckoning may err, in standard deviations.

    Attributes
    ----------
    distance_share : float
        Of a distance along and across it [m/m].
    turn_share : float
        Of a turn [rad/rad].
    turn_per_metre : float
        Of the heading over a distance [rad/m].
    distance_floor, turn_floor : float
        Of any motion at all [m, rad].
    distance_noise, turn_noise, turn_noise_of_distance : float
        What is different each time rather than the same, so that no one can learn it: of a distance from its
        root, of a turn from its root, and of a turn from the root of the distance [m^(1/2), rad^(1/2),
        rad/m^(1/2)].
    fading : float
        Share of what it has learned of its wheels that a robot forgets in each metre or radian: tyres lose
        air, and floors differ.
    most_deviations : float
        By at most so many of the standard deviations above a robot corrects its odometry.
    """

    distance_share: Positive = 0.1
    turn_share: Positive = 0.1
    turn_per_metre: Positive = 0.05
    distance_floor: Positive = 0.005
    turn_floor: Positive = 0.002
    distance_noise: Positive = 0.03
    turn_noise: Positive = 0.04
    turn_noise_of_distance: Positive = 0.03
    fading: Annotated[float, share(has_maximum=False)] = 0.0005
    most_deviations: FromZero = 2.0

    def __post_init__(self) -> None:
        check_settings(self, type(self).__name__)

    def covariance(self, distance: float, turn: float) -> NDArray[np.float64]:
        """Return the covariance (3, 3) of a motion of a given size.

        In the frame in which the motion began [m, rad].
        """
        along = (self.distance_share * distance + self.distance_floor) ** 2
        heading = (self.turn_share * abs(turn) + self.turn_per_metre * distance + self.turn_floor) ** 2
        return np.diag([along, along, heading])

    def noise(self, distance: float, turn: float) -> NDArray[np.float64]:
        """Return the covariance (3, 3) of the random errors of a motion [m, rad].

        Random errors differ each time, for motions of the same size.
        """
        along = self.distance_noise**2 * abs(distance) + self.distance_floor**2
        heading = (
            self.turn_noise**2 * abs(turn)
            + self.turn_noise_of_distance**2 * abs(distance)
            + self.turn_floor**2
        )
        return np.diag([along, along, heading])
