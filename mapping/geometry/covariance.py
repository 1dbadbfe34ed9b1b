"""Covariances of poses, as seen from other frames."""

import math

import numpy as np
from numpy.typing import NDArray


def turned(matrix: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Return a (3, 3) covariance or information of x, y, theta in another frame.

    Its own frame is rotated by an angle [rad] in that frame.
    """
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(turn @ matrix @ turn.T, np.float64)
