"""What a robot knows of another."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Teammate:
    """What a robot knows of another.

    Attributes
    ----------
    pose : (3,) float64
        x, y, theta in the knowing robot's map frame [m, rad].
    age_s : float
        Age of what is known [s].
    radius : float
        Radius of the body [m].
    has_ended : bool
        Whether it has ended and stands where it is.
    """

    pose: NDArray[np.float64]
    age_s: float
    radius: float
    has_ended: bool
